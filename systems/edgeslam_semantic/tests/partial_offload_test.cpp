// SPDX-License-Identifier: Apache-2.0
// edgeSLAM's variants in virtual time on generated pictures.
#include <gtest/gtest.h>

#include <set>
#include <sstream>
#include <utility>

#include "base/error.hpp"
#include "edgeslam_semantic/tests/semantic_run.hpp"

namespace slambed {
namespace {

class PartialOffload : public SemanticRun {
 protected:
  static nlohmann::json partial(bool nrcc, bool adapt) {
    nlohmann::json chosen = params();
    chosen["full_offload"] = false;
    chosen["nrcc"] = nrcc;
    chosen["adapt"] = adapt;
    return chosen;
  }
  static int tracked(const Played& run) {
    int count = 0;
    for (const auto& frame : run.of("frame_answered")) count += frame["ok"].get<bool>();
    return count;
  }
  static std::size_t lines(const std::string& text) {
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  }
};

TEST_F(PartialOffload, TheMobileTracksEveryFrameAndNeverWaits) {
  scenario["link"]["up"]["delay_us"] = {200'000};
  scenario["link"]["down"]["delay_us"] = {200'000};
  const Played run = play(partial(false, true));
  EXPECT_EQ(run.of("frame_answered").size(), std::size_t{kFrames});
  EXPECT_TRUE(run.of("frame_dropped").empty());
  EXPECT_GT(tracked(run), kFrames / 2);
  EXPECT_GT(lines(run.trajectory), std::size_t{kFrames} / 2);
  for (const auto& frame : run.of("frame_answered")) {
    EXPECT_LE(frame["parts_error_ms"], kClosure_ms);
    EXPECT_LT(frame["latency_ms"], 200.0) << "an answer of the edge takes 400 ms";
  }
  EXPECT_EQ(run.stages("segment"), 0);
}

TEST_F(PartialOffload, SlicesComeInOrderAndTheMobileTakesThem) {
  const Played run = play(partial(false, true));
  const auto sent = run.of("slice_sent"), applied = run.of("slice_applied");
  ASSERT_GT(applied.size(), 3u);
  EXPECT_TRUE(run.of("slice_declined").empty());
  EXPECT_GE(sent.size(), applied.size());
  std::uint64_t before = 0;
  for (const auto& slice : applied) {
    EXPECT_GT(slice["number"].get<std::uint64_t>(), before);
    before = slice["number"];
    EXPECT_GT(slice["edge_points"], 50);
    EXPECT_GE(slice["local_points"].get<int>(), slice["edge_points"].get<int>() / 2);
  }
}

TEST_F(PartialOffload, KeyFramesThatLeftTheWindowAreForgotten) {
  auto narrow = partial(false, true);
  narrow["local_keyframes"] = 2;
  const Played run = play(narrow);
  const auto applied = run.of("slice_applied");
  ASSERT_GT(applied.size(), 5u);
  const auto made = run.of("keyframe_created");
  for (const auto& slice : applied) {
    const auto since = std::count_if(made.begin(), made.end(), [&](const auto& keyframe) {
      return keyframe["t_ns"] < slice["t_ns"] && keyframe["keyframe"] > slice["keyframe"];
    });
    EXPECT_LE(slice["kept_keyframes"].get<int>(), 8 + since) << slice;
  }
  EXPECT_LT(applied.back()["kept_keyframes"].get<std::size_t>(), made.size() / 2);
}

/// Both nodes remember only ids of the window and of uploads in flight.
TEST_F(PartialOffload, NothingGrowsWithTheLengthOfARun) {
  constexpr int kLong = 5 * kFrames, kWindow = 3;
  sequence = folder.path() / "long";
  generate({}, sequence, kLong);
  write_masks(kHeight * 3 / 4, kLong);
  auto narrow = partial(true, false);
  narrow["local_keyframes"] = kWindow;
  const Played run = play(narrow);
  const auto sent = run.of("keyframe_sent"), applied = run.of("slice_applied");
  ASSERT_GT(sent.size(), 50u);
  std::size_t ids = 0;  // all ids of the run
  for (const auto& keyframe : sent) ids += 1 + keyframe["new_points"].get<std::size_t>();
  const auto most = [&](const std::vector<nlohmann::json>& events, const char* field, bool late) {
    std::size_t found = 0;
    for (std::size_t i = 0; i < events.size(); ++i)
      if ((i >= events.size() / 2) == late)
        found = std::max(found, events[i][field].get<std::size_t>());
    return found;
  };
  EXPECT_LT(most(applied, "kept_ids", true), ids / 4);
  EXPECT_LT(most(applied, "kept_ids", true), 2 * most(applied, "kept_ids", false));
  EXPECT_LE(most(run.of("slice_sent"), "labeled_keyframes", true), std::size_t{kWindow} + 1);
  EXPECT_LE(most(applied, "kept_keyframes", true), std::size_t{kWindow} + 8);
}

TEST_F(PartialOffload, PicturesGoUpOnlyToBeSegmentedAndEachIsSegmentedOnce) {
  const Played without = play(partial(false, true));
  for (const auto& keyframe : without.of("keyframe_sent")) EXPECT_EQ(keyframe["jpeg_bytes"], 0);
  write_masks(kHeight * 3 / 4);
  const Played run = play(partial(true, true));
  const auto sent = run.of("keyframe_sent");
  ASSERT_GT(sent.size(), 3u);
  for (const auto& keyframe : sent) EXPECT_GT(keyframe["jpeg_bytes"], 1000);
  EXPECT_EQ(run.stages("segment"), static_cast<int>(sent.size()));
  EXPECT_GT(tracked(run), kFrames / 2);
}

TEST_F(PartialOffload, MasksTravelOnToFramesThatNeverWentUp) {
  write_masks(kHeight / 2);
  const Played run = play(partial(true, true));
  ASSERT_FALSE(run.of("mask_applied").empty());
  std::set<std::uint64_t> uploaded;
  for (const auto& keyframe : run.of("keyframe_sent"))
    uploaded.insert(keyframe["frame"].get<std::uint64_t>());
  int culled_elsewhere = 0;
  for (const auto& frame : run.of("frame_answered")) {
    if (frame["mask_age_frames"] < 0) {
      EXPECT_EQ(frame["culled"], 0);
    }
    if (!uploaded.contains(frame["frame"].get<std::uint64_t>()))
      culled_elsewhere += frame["culled"].get<int>();
  }
  EXPECT_GT(culled_elsewhere, 100);
}

TEST_F(PartialOffload, RowsFollowTheLinkAndNoFeatureIsAboveItsOctaves) {
  write_masks(kHeight * 3 / 4);
  scenario["link"]["up"]["delay_us"] = {100'000};
  const Played far = play(partial(true, true));
  EXPECT_EQ(far.of("keyframe_sent").back()["row"], 5);
  EXPECT_EQ(far.of("keyframe_sent").back()["n_l"], 4);
  EXPECT_EQ(far.of("keyframe_sent").back()["n_m"], 0.6);
  scenario["link"]["up"]["delay_us"] = {500};
  scenario["link"]["down"]["delay_us"] = {500};
  const Played near = play(partial(true, true));
  EXPECT_LE(near.of("keyframe_sent").back()["row"], 3);
  EXPECT_FALSE(near.of("row_changed").empty());
  auto fixed = partial(true, true);
  fixed["fixed_row"] = 4;
  for (const auto& keyframe : play(fixed).of("keyframe_sent")) EXPECT_EQ(keyframe["row"], 4);
}

/// With row 5's four octaves, the first two views sometimes gave a wrong direction of motion, and
/// frames were off until the fourth keyframe came back.
TEST_F(PartialOffload, AMapBeginsWithThePapersDefaultsWhateverTheLink) {
  for (const int delay_us : {1000, 60'000}) {
    scenario["link"]["up"]["delay_us"] = scenario["link"]["down"]["delay_us"] = {delay_us};
    const auto sent = play(partial(false, true)).of("keyframe_sent");
    ASSERT_GT(sent.size(), 2u);
    EXPECT_EQ(sent.front()["reason"], "first");
    EXPECT_EQ(sent.front()["row"], 3) << delay_us;
    EXPECT_EQ(sent.front()["n_l"], 6) << delay_us;
    EXPECT_NE(sent.back()["row"], 3) << delay_us << ": once the link is known";
  }
}

/// Table I's f_min is a number of camera frames, also on a device that tracks every third of them.
TEST_F(PartialOffload, ABusyDeviceWaitsNoLongerForItsNextKeyFrame) {
  constexpr int kLong = 3 * kFrames, kLeastFrames = 10;  // f_min of row 1
  sequence = folder.path() / "long";
  generate({}, sequence, kLong);
  scenario["devices"]["mobile"]["stages"]["extract"]["a_us"] = 180'000;
  auto fixed = partial(false, true);
  fixed["fixed_row"] = 1;
  const Played run = play(fixed);
  ASSERT_LT(run.of("frame_answered").size(), std::size_t{kLong} / 2);
  std::vector<int> gaps;  // in camera frames, once the map has f_min keyframes
  int uploads = 0, before = 0;
  for (const auto& keyframe : run.of("keyframe_sent")) {
    const int frame = keyframe["frame"];
    if (++uploads > kLeastFrames + 1) gaps.push_back(frame - before);
    before = frame;
  }
  ASSERT_GT(gaps.size(), 2u);
  std::sort(gaps.begin(), gaps.end());
  EXPECT_LT(gaps[gaps.size() / 2], 2 * kLeastFrames);
}

TEST_F(PartialOffload, WithoutAdaptationTheNextGoesUpWhenTheAnswersAreBack) {
  write_masks(kHeight * 3 / 4);
  const Played run = play(partial(true, false));
  const auto sent = run.of("keyframe_sent");
  ASSERT_GT(sent.size(), 5u);
  for (std::size_t i = 1; i < sent.size(); ++i) {
    EXPECT_EQ(sent[i]["n_l"], 8);
    EXPECT_EQ(sent[i]["n_m"], 0.8);
    EXPECT_GE(sent[i]["t_ns"].get<double>() - sent[i - 1]["t_ns"].get<double>(), kSegment_ms * 1e6);
  }
}

TEST_F(PartialOffload, EqualRunsGiveEqualBytes) {
  write_masks(kHeight * 3 / 4);
  const Played first = play(partial(true, true));
  EXPECT_EQ(play(partial(true, true)).text, first.text);
  scenario["feature_cache"] = {{"path", folder.path() / "x.features"}, {"key", "features"}};
  EXPECT_EQ(play(partial(true, true)).text, first.text) << "with the caches, made now";
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "x-4.features"));
  EXPECT_EQ(play(partial(true, true)).text, first.text) << "with the caches, read";
}

TEST_F(PartialOffload, GoesOnWhileTheEdgeStandsStill) {
  scenario["edge_frozen_s"] = {{1.5, 2.5}};
  const Played run = play(partial(false, true));
  EXPECT_EQ(run.of("frame_answered").size(), std::size_t{kFrames});
  EXPECT_GT(run.of("slice_applied").back()["t_ns"].get<double>(), 2.5e9);
  EXPECT_GT(tracked(run), kFrames / 2);
}

/// Tracking is lost with a young map: both nodes start a new one, and late slices of the old map
/// are declined.
TEST_F(PartialOffload, AMapThatIsGivenUpBeginsAgainOnBothNodes) {
  synth::SensorOptions covered;
  covered.blackout_start_s = 1.2;
  covered.blackout_end_s = 1.6;
  sequence = folder.path() / "covered";
  generate(covered, sequence);
  scenario["link"]["down"]["delay_us"] = {300'000};
  auto sparse = partial(false, true);
  sparse["local_references"] = false;
  sparse["keyframes_under_way"] = 1;
  const Played run = play(sparse);
  ASSERT_FALSE(run.of("reset").empty());
  ASSERT_GE(run.of("initialized").size(), 2u);
  const double again = run.of("initialized").back()["t_ns"];
  std::size_t applied = 0;
  std::uint64_t first = 0;
  for (const auto& keyframe : run.of("keyframe_sent"))
    if (keyframe["reason"] == "first") first = keyframe["keyframe"];
  for (const auto& slice : run.of("slice_applied")) {
    if (slice["t_ns"] < again) continue;
    ++applied;
    EXPECT_GE(slice["keyframe"], first) << "of the map that was given up";
  }
  EXPECT_GT(applied, 0u);
  EXPECT_TRUE(run.of("frame_answered").back()["ok"]);
}

TEST_F(PartialOffload, ANodeWithoutSegmentationSaysSo) {
  try {
    play(partial(true, true));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("nothing segments the pictures"), std::string::npos);
  }
}

/// Recording is only for scoring after the run and must not change the run.
TEST_F(PartialOffload, FeaturesAreToldWhereAskedAndChangeNothing) {
  write_masks(kHeight / 2);
  nlohmann::json chosen = partial(true, true);
  const Played without = play(chosen);
  EXPECT_TRUE(without.of("frame_features").empty());
  chosen["record_culling"] = true;
  const Played run = play(chosen);
  EXPECT_EQ(run.trajectory, without.trajectory);
  const auto reported = run.of("frame_features"), answered = run.of("frame_answered");
  ASSERT_EQ(reported.size(), answered.size());
  const auto pixels = [](const nlohmann::json& text) {
    std::istringstream numbers(text.get<std::string>());
    std::vector<std::pair<int, int>> found;
    for (int u, v; numbers >> u >> v;) found.emplace_back(u, v);
    return found;
  };
  std::size_t below = 0, all = 0;
  for (std::size_t i = 0; i < reported.size(); ++i) {
    const auto kept = pixels(reported[i]["kept"]), culled = pixels(reported[i]["culled"]);
    EXPECT_EQ(reported[i]["frame"], answered[i]["frame"]);
    EXPECT_EQ(culled.size(), answered[i]["culled"]);
    EXPECT_EQ(kept.size() + culled.size(), answered[i]["features"]);
    for (const auto& [u, v] : culled) {
      EXPECT_TRUE(u >= 0 && u < kWidth && v >= 0 && v < kHeight) << u << ' ' << v;
      below += v >= kHeight / 2 - 3;
    }
    all += culled.size();
  }
  ASSERT_GT(all, 100u);
  EXPECT_GT(below, all / 2) << "the mask is the lower half";
}

}  // namespace
}  // namespace slambed
