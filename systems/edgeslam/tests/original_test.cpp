// SPDX-License-Identifier: Apache-2.0
// Edge-SLAM's original behavior, one switch at a time: its effects, not its costs.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "edgeslam/edgeslam.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed {
namespace {

using testing::PairLink;
using testing::PairResult;

nlohmann::json ours() {
  auto params = testing::enhanced();
  params.update(testing::ours());
  return params;
}

PairResult run_original(const nlohmann::json& params, const PairLink& link = {}, int frames = 120) {
  return testing::run_pair(edgeslam_system(), params, frames, 10, link, testing::turn);
}

double first_update_s(const PairResult& result) {
  const auto sent = result.of("update_sent");
  return sent.empty() ? -1 : sent.front()["t_ns"].get<double>() / 1e9;
}

TEST(Original, TheFirstUpdateIsDueWhenItIsAskedFor) {
  auto params = ours();
  EXPECT_GE(first_update_s(run_original(params)), 5.0);
  params["first_update_s"] = 0.0;
  const PairResult early = run_original(params);
  EXPECT_LT(first_update_s(early), 0.5) << "with the first keyframe";
  const auto sent = early.of("update_sent");
  ASSERT_GE(sent.size(), 2u);
  EXPECT_GE(sent[1]["t_ns"].get<double>() - sent[0]["t_ns"].get<double>(), 4.99e9);
}

int declined_as_busy(const PairResult& result) {
  int count = 0;
  for (const auto& event : result.of("keyframe_declined"))
    count += event["reason"] == "mapper busy";
  return count;
}

TEST(Original, KeyframesWaitUnreadForAnIdleMapper) {
  PairLink link;
  link.edge_device = testing::uniform_device(40'000);  // a keyframe takes longer than a frame
  auto params = ours();
  const PairResult on_arrival = run_original(params, link);
  params["admission"] = "when_idle";
  const PairResult when_idle = run_original(params, link);
  EXPECT_GT(declined_as_busy(on_arrival), 0);
  EXPECT_GT(when_idle.of("keyframe_received").size(), 5u);
  EXPECT_EQ(when_idle.end_reason, "bye");
  int dropped = 0;
  for (const auto& event : when_idle.of("message"))
    dropped += event["message"] == "KEYFRAME" && event.value("dropped", false);
  EXPECT_LT(declined_as_busy(when_idle), declined_as_busy(on_arrival));
  EXPECT_GT(dropped, 0) << "the queue of two holds the newest";
}

TEST(Original, TrackingWaitsWhileAnUpdateIsBuiltBesideIt) {
  PairLink link;
  link.mobile_device = testing::uniform_device(40'000);
  link.mobile_device->stages["parse"].a_us =
      200'000;  // an update takes the other thread several frames
  auto params = ours();
  params["fast_motion_ms"] = 0.0;
  params["sync_period_s"] = 1.0;
  const auto longest = [&](const char* mode) {
    params["map_update"] = mode;
    double pause_ms = 0;
    for (const auto& update : run_original(params, link).of("update_applied"))
      pause_ms = std::max(pause_ms, update["pause_ms"].get<double>());
    return pause_ms;
  };
  EXPECT_NEAR(longest("parallel"), 40, 1) << "the swap alone";
  EXPECT_GT(longest("parallel_waiting"), 45);
}

/// Names of tracking's stages right before each time an update is applied.
std::set<std::string> before_updates(const PairResult& result) {
  std::set<std::string> found;
  std::string last;
  for (const auto& event : result.mobile) {
    if (event["type"] != "stage" || event["worker"] != "tracking") continue;
    const std::string name = event["name"];
    if (name == "apply_update") found.insert(last);
    last = name;
  }
  return found;
}

TEST(Original, AnUpdateIsLookedForBeforeOrAfterExtraction) {
  auto params = ours();
  params["fast_motion_ms"] = 0.0;
  params["sync_period_s"] = 0.5;
  const auto before = before_updates(run_original(params));
  ASSERT_FALSE(before.empty());
  EXPECT_FALSE(before.contains("extract"));
  params["update_poll"] = "after_extraction";
  EXPECT_EQ(before_updates(run_original(params)), std::set<std::string>{"extract"});
}

TEST(Original, BeforeTheFirstUpdateFewKeyframesAreMadeWhereOnlyMappingAddsObservations) {
  auto params = ours();
  const auto made = [&] {
    int count = 0;
    for (const auto& event : run_original(params).of("keyframe_created"))
      count += event["t_ns"].get<double>() < 5e9;
    return count;
  };
  const int with = made();
  params["local_observations"] = false;
  const int without = made();
  EXPECT_GT(with, 3 * without);
  EXPECT_GE(without, 2);
}

TEST(Original, TracksAnEasyWalkWithAllSwitchesTogether) {
  auto params = testing::conventional();
  params.update({{"codec", "compatibility"},
                 {"reference_fallback", "words"},
                 {"point_identity", "tracker_ids"},
                 {"last_frame_points", "by_rank"},
                 {"reference_after_update", "newest"},
                 {"reanchor_last", false},
                 {"local_observations", false},
                 {"admission", "when_idle"},
                 {"cull_age", "keyframe_ids"},
                 {"local_map_size", 6},
                 {"max_frames", 30},
                 {"first_update_s", 0.0},
                 {"update_poll", "after_extraction"},
                 {"prior_map", ""}});
  const PairResult result = run_original(params, {.one_way_ms = {10}});
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_GT(result.edge_counts.keyframes, 2u);
  EXPECT_FALSE(result.of("update_applied").empty());
  EXPECT_EQ(result.of("frame_tracked").size() + result.of("frame_dropped").size(), 120u);
}

}  // namespace
}  // namespace slambed
