// SPDX-License-Identifier: Apache-2.0
// A new edge process replaces one that was killed.
#include <gtest/gtest.h>

#include "edgeslam_semantic/tests/semantic_pair.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

constexpr int kTwice = 2 * kFrames, kLabelFrames = 8;
constexpr EdgeLife kLife{.dies = 2500ms, .comes_back = 4500ms};

class EdgeRestart : public SemanticPair {
 protected:
  static void SetUpTestSuite() {
    SemanticRun::SetUpTestSuite();
    generate({}, shared->path() / "long", kTwice);
  }
  EdgeRestart() { sequence = shared->path() / "long"; }

  static nlohmann::json edgeslam(bool nrcc, bool adapt) {
    nlohmann::json chosen = params();
    chosen["full_offload"] = false;
    chosen["nrcc"] = nrcc;
    chosen["adapt"] = adapt;
    chosen["label_frames"] = kLabelFrames;
    return chosen;
  }
  /// Masks the lower half of the picture.
  static std::optional<FrameMasks> below(std::uint64_t) {
    constexpr std::uint32_t kOutside = kWidth * kHeight / 2;
    return FrameMasks{kWidth,
                      kHeight,
                      {{.object_class = 0,
                        .moves = true,
                        .score = 1,
                        .runs = {kOutside, kWidth * kHeight - kOutside},
                        .body = {}}}};
  }
  static Duration when(const nlohmann::json& event) { return Duration(event["t_ns"].get<long>()); }
  static std::vector<nlohmann::json> after(const std::vector<nlohmann::json>& events, Duration t) {
    std::vector<nlohmann::json> found;
    for (const auto& event : events)
      if (when(event) >= t) found.push_back(event);
    return found;
  }
};

TEST_F(EdgeRestart, TheNewEdgesMapBeginsWithTheMobiles) {
  for (const bool adapt : {true, false}) {
    const Played run = play_pair(edgeslam(false, adapt), below, kLife);
    const auto restarted = run.of("edge_restarted");
    ASSERT_EQ(restarted.size(), 1u) << adapt;
    EXPECT_EQ(restarted.front()["session"], 2);
    EXPECT_LT(when(restarted.front()), kLife.comes_back + 500ms);
    EXPECT_EQ(run.of("frame_answered").size(), std::size_t{kTwice}) << "tracking never waits";
    EXPECT_TRUE(run.of("track_lost").empty());
    for (const auto& frame : after(run.of("frame_answered"), kLife.dies)) EXPECT_TRUE(frame["ok"]);
    // Uploads and slices continue in the mobile's world and scale.
    EXPECT_GT(after(run.of("keyframe_sent"), when(restarted.front())).size(), 3u) << adapt;
    const auto slices = after(run.of("slice_applied"), kLife.comes_back);
    ASSERT_GT(slices.size(), 3u) << adapt;
    EXPECT_EQ(slices.front()["number"], 1);
    for (const auto& slice : slices) {
      EXPECT_GE(slice["keyframe"], restarted.front()["keyframe"]) << "of the dead edge";
      EXPECT_LT(slice["moved_m"], 0.1);
      EXPECT_NEAR(slice["scale"], 1, 0.05);
    }
    EXPECT_TRUE(after(run.of("slice_declined"), when(restarted.front())).empty());
    EXPECT_GT(slices.back()["edge_points"], 100);
  }
}

TEST_F(EdgeRestart, LabelsAgeOutAndComeBackWithMasks) {
  const Played run = play_pair(edgeslam(true, true), below, kLife);
  ASSERT_EQ(run.of("edge_restarted").size(), 1u);
  int culled_before = 0, culled_after = 0, unlabeled = 0;
  const auto masks = after(run.of("mask_applied"), kLife.comes_back);
  ASSERT_FALSE(masks.empty());
  for (const auto& frame : run.of("frame_answered")) {
    const int culled = frame["culled"], age = frame["mask_age_frames"];
    const Duration t = when(frame);
    if (t < kLife.dies) culled_before += culled;
    if (t > when(masks.front())) culled_after += culled;
    if (age > kLabelFrames) {
      EXPECT_EQ(culled, 0) << frame;
      ++unlabeled;
    }
  }
  EXPECT_GT(culled_before, 100);
  EXPECT_GT(unlabeled, 5) << "the edge was away for longer than labels last";
  EXPECT_GT(culled_after, 100);
}

/// Uploads queued for the dead edge belong to a map that the new edge does not have.
TEST_F(EdgeRestart, WhatWaitedForTheOldEdgeIsDeclined) {
  const Played run = play_pair(edgeslam(true, false), below, kLife);
  ASSERT_EQ(run.of("edge_restarted").size(), 1u);
  const auto declined = run.of("keyframe_declined");
  ASSERT_FALSE(declined.empty());
  for (const auto& keyframe : declined) EXPECT_EQ(keyframe["reason"], "of another map");
  const auto id = [](const nlohmann::json& event) {
    return event["keyframe"].get<std::uint64_t>();
  };
  const std::uint64_t restart = id(run.of("edge_restarted").front());
  for (const auto& keyframe : declined) EXPECT_LT(id(keyframe), restart);
  for (const auto& keyframe : after(run.of("keyframe_received"), kLife.comes_back))
    EXPECT_GE(id(keyframe), restart);
}

/// While no slices come, the local map has only the newest uploads and the references since the
/// last but one.
TEST_F(EdgeRestart, TheLocalMapDoesNotGrowWhileTheEdgeIsDead) {
  constexpr int kLong = 330, kKept = 2;
  sequence = folder.path() / "longer";
  generate({}, sequence, kLong);
  nlohmann::json chosen = edgeslam(false, false);
  chosen["local_keyframes"] = kKept;
  const EdgeLife life{.dies = 1500ms, .comes_back = 20s};
  const Played run = play_pair(chosen, below, life);
  const auto before = [&](const char* type) {
    std::vector<std::uint64_t> ids;
    for (const auto& event : run.of(type))
      if (when(event) < life.comes_back) ids.push_back(event["keyframe"]);
    return ids;
  };
  const auto sent = before("keyframe_sent"), made = before("keyframe_created");
  ASSERT_GT(sent.size(), 5u);
  const auto since = std::count_if(
      made.begin(), made.end(), [&](std::uint64_t id) { return id >= sent[sent.size() - kKept]; });
  EXPECT_EQ(kept_keyframes, static_cast<std::uint64_t>(since));
  EXPECT_LT(kept_keyframes, made.size() / 2);
  // Tracking is not lost, and the new edge's map starts from the local map.
  EXPECT_TRUE(run.of("track_lost").empty());
  ASSERT_EQ(run.of("edge_restarted").size(), 1u);
  EXPECT_GT(after(run.of("slice_applied"), life.comes_back).size(), 3u);
}

/// After the pause the edge's window has keyframes whose features the mobile no longer keeps.
TEST_F(EdgeRestart, AnEdgeThatStoodStillForLongGoesOn) {
  scenario["edge_frozen_s"] = {{1.0, 6.5}};
  nlohmann::json chosen = edgeslam(false, false);
  chosen["local_keyframes"] = 2;
  const Played run = play(chosen);
  EXPECT_TRUE(run.of("edge_restarted").empty());
  EXPECT_TRUE(run.of("track_lost").empty());
  const auto slices = after(run.of("slice_applied"), 6500ms);
  ASSERT_GT(slices.size(), 3u);
  EXPECT_GT(slices.back()["edge_points"], 100);
  EXPECT_LE(slices.back()["kept_keyframes"].get<std::size_t>(), 10u);
}

TEST_F(EdgeRestart, FullyOffloadedTheTrajectoryIsThatOfTheNewEdgesMapAlone) {
  nlohmann::json chosen = edgeslam(false, false);
  chosen["full_offload"] = true;
  const EdgeLife life{.dies = 1500ms, .comes_back = 1700ms};
  const Played run = play_pair(chosen, below, life);
  const auto restarted = run.of("edge_restarted");
  ASSERT_EQ(restarted.size(), 1u);
  EXPECT_EQ(restarted.front()["session"], 2);
  std::size_t of_new_map = 0, of_old_map = 0;
  for (const auto& frame : run.of("frame_answered")) {
    if (!frame["ok"]) continue;
    ++(when(frame) >= when(restarted.front()) ? of_new_map : of_old_map);
  }
  ASSERT_GT(of_old_map, 5u);
  ASSERT_GT(of_new_map, 5u);
  const auto lines = std::count(run.trajectory.begin(), run.trajectory.end(), '\n');
  EXPECT_EQ(lines, static_cast<long>(of_new_map) + 1);
}

/// The frame sent to the dead edge is lost. The new connection reveals this long before the
/// timeout.
TEST_F(EdgeRestart, FullyOffloadedTheNextFrameGoesAsSoonAsTheNewEdgeIsThere) {
  nlohmann::json chosen = edgeslam(false, false);
  chosen["full_offload"] = true;
  const EdgeLife life{.dies = 1500ms, .comes_back = 3500ms};
  const Played run = play_pair(chosen, below, life);
  const auto given_up = run.of("frames_unanswered");
  ASSERT_EQ(given_up.size(), 1u);
  EXPECT_EQ(given_up.front()["frames"], 1);
  EXPECT_EQ(when(given_up.front()), life.comes_back);
  const auto sent = after(run.of("frame_sent"), life.comes_back);
  ASSERT_FALSE(sent.empty());
  EXPECT_LT(when(sent.front()), life.comes_back + 100ms);
  EXPECT_GT(sent.size(), 30u);
}

/// Frames sent while no edge is connected wait for the new edge, which answers them.
TEST_F(EdgeRestart, FullyOffloadedWhatWaitedForTheNewEdgeIsWaitedFor) {
  nlohmann::json chosen = edgeslam(false, false);
  chosen["full_offload"] = true;
  chosen["offload_window"] = 0;
  const EdgeLife life{.dies = 5000ms, .comes_back = 7900ms};
  const Played run = play_pair(chosen, below, life);
  std::size_t waited = 0, answered = 0;
  for (const auto& frame : run.of("frame_sent"))
    waited += when(frame) >= life.dies && when(frame) < life.comes_back;
  for (const auto& frame : run.of("frame_answered")) answered += when(frame) >= life.comes_back;
  ASSERT_GT(waited, 30u);
  EXPECT_GE(answered, waited);
}

}  // namespace
}  // namespace slambed
