// SPDX-License-Identifier: Apache-2.0
// Edge-SLAM's two nodes in virtual time on a synthetic scene: repeatable, and independent of this
// machine's timing.
#include "edgeslam/edgeslam.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "edgeslam/tests/edgeslam_runs.hpp"

namespace slambed {
namespace {

namespace runs = testing::edgeslam;
using testing::PairLink;
using testing::PairResult;
using testing::pose_at;

/// Largest allowed distance between a keyframe of the edge's map and the camera's true position.
constexpr double kPositionTolerance_m = 0.02;

double sum_of_parts(const nlohmann::json& applied) {
  double sum = 0;
  for (const char* part : {"t_track_ms", "t_me_ms", "t_rkf_ms", "t_lm_ms", "t_wait_ms", "t_plmu_ms",
                           "t_em_ms", "t_mu_ms"}) {
    EXPECT_GE(applied[part].get<double>(), 0) << part;
    sum += applied[part].get<double>();
  }
  return sum;
}

class EdgeSlamVariants : public ::testing::TestWithParam<bool> {
 protected:
  nlohmann::json params() const { return GetParam() ? runs::enhanced() : runs::conventional(); }
};

TEST_P(EdgeSlamVariants, TracksEveryFrameWithMappingOnTheEdgeOnly) {
  const PairResult result = runs::run(params());
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
  const auto frames = result.of("frame_tracked");
  EXPECT_EQ(frames.size(), 160u);
  for (const auto& frame : frames) EXPECT_EQ(frame["state"], "ok") << frame;
  EXPECT_TRUE(result.of("track_lost").empty());
  std::set<std::string> on_mobile, on_edge;
  for (const auto& event : result.mobile) {
    if (event["type"] == "stage") on_mobile.insert(event["name"].get<std::string>());
  }
  for (const auto& event : result.edge) {
    if (event["type"] == "stage") on_edge.insert(event["name"].get<std::string>());
  }
  std::set<std::string> expected{"extract", "track", "create_keyframe", "serialize", "parse"};
  if (params()["map_update"] == "serial") {
    expected.insert({"insert_keyframes", "update_reference", "update_last_frame", "clean_map"});
  } else {
    expected.insert("apply_update");
  }
  EXPECT_EQ(on_mobile, expected);
  EXPECT_TRUE(on_edge.contains("bundle") && on_edge.contains("prepare_update"));
  EXPECT_FALSE(on_edge.contains("track"));
  EXPECT_GT(result.edge_counts.keyframes, 5u);
  EXPECT_EQ(result.edge_counts.keyframes, result.mobile_counts.keyframes);
  EXPECT_EQ(result.edge_counts.points, result.mobile_counts.points);
}

TEST_P(EdgeSlamVariants, UpdatesComeEveryPeriodAndTheirDelaysAddUp) {
  const PairResult result = runs::run(params());
  const auto sent = result.of("update_sent");
  ASSERT_GE(sent.size(), 2u);
  for (std::size_t i = 1; i < sent.size(); ++i) {
    EXPECT_GE(sent[i]["t_ns"].get<double>() - sent[i - 1]["t_ns"].get<double>(), 4.99e9);
  }
  const auto applied = result.of("update_applied");
  ASSERT_FALSE(applied.empty());
  EXPECT_EQ(applied.size() + result.of("update_declined").size(), sent.size());
  for (const auto& update : applied) {
    EXPECT_LE(update["keyframes"].get<int>(), params()["n_kf"].get<int>());
    EXPECT_NEAR(sum_of_parts(update), update["t_total_ms"].get<double>(), 0.01);
  }
}

TEST_P(EdgeSlamVariants, AnUpdateTellsHowLongTrackingStoodStill) {
  // Every stage takes 2 ms: serial has parsing and the four update stages, parallel only the swap.
  const double pause_ms = params()["map_update"] == "serial" ? 10 : 2;
  const auto applied = runs::run(params()).of("update_applied");
  ASSERT_FALSE(applied.empty());
  for (const auto& update : applied) EXPECT_NEAR(update["pause_ms"].get<double>(), pause_ms, 0.01);
}

TEST_P(EdgeSlamVariants, TheMapStartsWithTheFirstKeyframeThatComes) {
  PairLink link;
  link.lost = 3;
  const PairResult result = runs::run_over(link, params());
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_TRUE(result.of("track_lost").empty());
  int wanted = 0;
  for (const auto& message : result.of("message")) {
    wanted += message["message"] == "KEYFRAME_WANTED";
  }
  EXPECT_GT(wanted, 0);
  const auto received = result.of("keyframe_received");
  ASSERT_GT(received.size(), 5u);
  EXPECT_GT(received.front()["keyframe"].get<std::uint64_t>() & 0xffff, 3u);
  // Once the edge has a map it asks for nothing more, and the map is the mobile's.
  const double begun = received.front()["t_ns"];
  for (const auto& declined : result.of("keyframe_declined")) {
    if (declined["t_ns"].get<double>() > begun) {
      EXPECT_NE(declined["reason"], "not the first keyframe");
    }
  }
  EXPECT_GT(result.edge_counts.keyframes, 5u);
  for (const NewKeyFrame& keyframe : result.edge_map.keyframes) {
    const SE3 truth = pose_at(static_cast<int>(keyframe.frame_index)) * pose_at(0).inverse();
    EXPECT_LT((keyframe.T_cw.inverse().t - truth.inverse().t).norm(), kPositionTolerance_m)
        << "frame " << keyframe.frame_index;
  }
  // The map's first keyframe arrived with all points that it sees, not only with its new ones.
  const auto& first = result.edge_map.keyframes.front();
  EXPECT_GT(std::count_if(first.points.begin(), first.points.end(),
                          [](MapPointId id) { return bool(id); }),
            200);
  EXPECT_GE(result.of("update_applied").size(), 1u);
}

INSTANTIATE_TEST_SUITE_P(Variants, EdgeSlamVariants, ::testing::Values(false, true),
                         [](const auto& variant) {
                           return variant.param ? "Enhanced" : "Conventional";
                         });

TEST(EdgeSlam, KeyframesLeaveOutWhatTheEdgeNeedsNoMore) {
  auto params = runs::enhanced();
  params["fast_motion_ms"] = 0.0;
  const PairResult result = runs::run(params);
  const auto applied = result.of("update_applied");
  ASSERT_GE(applied.size(), 2u);
  const double first = applied.front()["t_ns"], second = applied[1]["t_ns"];
  // Keyframes carry observation counts of every point in view, which grow with the local map, until
  // an update tells which points are past probation.
  double before = 0, after = 0;
  for (const auto& message : result.of("message")) {
    if (message["message"] != "KEYFRAME") continue;
    const double sent = message["queued_ns"], bytes = message["bytes"];
    if (sent < first) before = std::max(before, bytes);
    // Right after an update the local map has few points on probation.
    if (sent > second && sent < second + 5e8) after = std::max(after, bytes);
  }
  EXPECT_GT(after, 0);
  EXPECT_LT(after, before - 1000);
}

TEST(EdgeSlam, TheSameSeedGivesTheSameBytes) {
  const PairResult first = runs::run(runs::enhanced(), 80),
                   second = runs::run(runs::enhanced(), 80);
  EXPECT_EQ(first.mobile_text, second.mobile_text);
  EXPECT_EQ(first.edge_text, second.edge_text);
  EXPECT_EQ(first.trajectory, second.trajectory);
}

TEST(EdgeSlam, ASlowLinkDelaysUpdates) {
  const PairResult near = runs::run(runs::enhanced()), far = runs::run(runs::enhanced(), 160, 400);
  ASSERT_FALSE(near.of("update_applied").empty());
  ASSERT_FALSE(far.of("update_applied").empty());
  for (const auto& update : far.of("update_applied")) {
    EXPECT_GE(update["t_me_ms"].get<double>(), 400);
    EXPECT_GE(update["t_em_ms"].get<double>(), 400);
    EXPECT_GE(update["t_total_ms"].get<double>(), 800);
  }
  for (const auto& update : near.of("update_applied")) {
    const double waited = update["t_wait_ms"].get<double>();
    EXPECT_LT(update["t_total_ms"].get<double>() - waited, 500);
  }
}

TEST(EdgeSlam, KeyframesMadeMeanwhileAreLostFromTheLocalMap) {
  auto params = runs::enhanced();
  params["fast_motion_ms"] = 0.0;
  const auto gap = [](const PairResult& result) {
    int lost = 0;
    for (const auto& update : result.of("update_applied"))
      lost += update["gap_keyframes"].get<int>();
    return lost;
  };
  const int near = gap(runs::run(params, 110)), far = gap(runs::run(params, 110, 1000));
  EXPECT_GT(far, near);
}

TEST(EdgeSlam, AnUpdateAfterEveryKeyframeWithThePeriodAtZero) {
  auto params = runs::enhanced();
  params["sync_period_s"] = 0.0;
  params["fast_motion_ms"] = 0.0;
  const PairResult result = runs::run(params, 60);
  EXPECT_EQ(result.of("update_sent").size(), result.of("keyframe_mapped").size());
  EXPECT_GT(result.of("update_applied").size(), 3u);
}

TEST(EdgeSlam, TheCompatibilityCodecCostsWhatEdgeSlamsMessagesCost) {
  auto params = runs::conventional();
  params["codec"] = "compatibility";
  params["min_local_keyframes"] = 1;
  const PairResult text = runs::run(params, 160, 20);
  const auto applied = text.of("update_applied");
  ASSERT_FALSE(applied.empty());
  for (const auto& update : applied) {
    EXPECT_GE(update["t_me_ms"].get<double>(), 60);  // length, OK, message
    EXPECT_GE(update["t_em_ms"].get<double>(), 60);
    EXPECT_NEAR(sum_of_parts(update), update["t_total_ms"].get<double>(), 0.01);
  }
  std::map<std::string, std::vector<double>> bytes;
  for (const auto& message : text.of("message")) {
    bytes[message["message"]].push_back(message["bytes"]);
  }
  EXPECT_GT(bytes["ACK"].size(), 2 * bytes["KEYFRAME"].size());
  ASSERT_FALSE(bytes["KEYFRAME"].empty());
  for (const double size : bytes["KEYFRAME"]) EXPECT_GT(size, 100e3);
  std::set<std::string> stages;
  for (const auto& event : text.of("stage")) stages.insert(event["name"].get<std::string>());
  EXPECT_TRUE(stages.contains("serialize_text") && stages.contains("parse_text"));
  EXPECT_FALSE(stages.contains("serialize") || stages.contains("parse"));
  EXPECT_TRUE(text.of("warning").empty());
  // The edge maps what was sent, as with the binary codec.
  EXPECT_GT(text.edge_counts.keyframes, 5u);
  EXPECT_EQ(text.of("frame_tracked").back()["state"], "ok");
}

}  // namespace
}  // namespace slambed
