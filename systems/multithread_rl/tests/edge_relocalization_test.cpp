// SPDX-License-Identifier: Apache-2.0
// A lost camera that the edge may relocalize, in virtual time on a synthetic scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

#include "multithread_rl/tests/lost_turn.hpp"

namespace slambed {
namespace {

using testing::far_back_at;
using testing::kDark;
using testing::kDarkFor;
using testing::lost_turn;
using testing::lost_turn_params;
using testing::PairLink;
using testing::PairResult;
using testing::same_place;
using testing::SyntheticScene;
using testing::turn;

constexpr int kPerUpdate = 6;  ///< keyframes per update, in tests that set it

double time_of(const nlohmann::json& event) { return event["t_ns"].get<double>(); }

int count_of(const PairResult& result, const std::string& message) {
  int found = 0;
  for (const auto& event : result.of("message")) found += event["message"] == message;
  return found;
}

class FoundOnTheEdge : public ::testing::TestWithParam<const char*> {};

TEST_P(FoundOnTheEdge, FindsALostCameraByItsPose) {
  const PairResult result = lost_turn(lost_turn_params(GetParam()), {.one_way_ms = {20}});
  ASSERT_EQ(result.of("track_lost").size(), 1u);
  const auto relocalized = result.of("relocalized");
  ASSERT_EQ(relocalized.size(), 1u);
  EXPECT_EQ(relocalized[0]["by"], "edge");
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "ok");
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_EQ(count_of(result, "RELOC_MAP"), 0);
  EXPECT_EQ(count_of(result, "FRAME"), 0);
  EXPECT_GT(count_of(result, "RELOC_FAIL"), 0);  // in the dark
  EXPECT_EQ(count_of(result, "SUSPEND"), 1);
  EXPECT_EQ(count_of(result, "RESUME"), 1);

  // The loss ends with a tracked frame, which is later than the one that the edge located.
  nlohmann::json used;
  for (const auto& reply : result.of("reloc_reply")) {
    if (reply["used"] == true) used = reply;
    const double sum = reply["request_ms"].get<double>() + reply["up_ms"].get<double>() +
                       reply["edge_ms"].get<double>() + reply["down_ms"].get<double>() +
                       reply["boundary_ms"].get<double>();
    EXPECT_NEAR(sum, reply["total_ms"].get<double>(), 0.01);
    EXPECT_NEAR(reply["local_ms"].get<double>(),
                reply["request_ms"].get<double>() + reply["boundary_ms"].get<double>(), 0.01);
    EXPECT_LT(reply["parts_error_ms"].get<double>(), 0.01);
    EXPECT_GE(reply["up_ms"].get<double>(), 20);
    const auto requests = result.of("reloc_request");
    EXPECT_TRUE(std::any_of(requests.begin(), requests.end(), [&](const auto& request) {
      return request["number"] == reply["number"] && request["bytes"] == reply["request_bytes"];
    }));
    EXPECT_GE(reply["down_ms"].get<double>(), 20);
  }
  ASSERT_FALSE(used.is_null());
  EXPECT_GT(relocalized[0]["frame"].get<int>(), used["frame"].get<int>());
  EXPECT_GT(time_of(relocalized[0]), time_of(used));

  // Poses continue at the camera's true place: it sees what it saw at second one.
  for (const auto& [keyframe, T_cw] : result.keyframe_poses) {
    for (const NewKeyFrame& made : result.edge_map.keyframes) {
      const auto frame = static_cast<int>(made.frame_index);
      if (made.id != keyframe || frame < kDark) continue;
      const SE3 truth = testing::pose_at(far_back_at(frame)) * testing::pose_at(0).inverse();
      EXPECT_LT((T_cw.inverse().t - truth.inverse().t).norm(), 0.03) << "frame " << frame;
    }
  }
}

TEST_P(FoundOnTheEdge, HoldsUpdatesFromLossToRecovery) {
  const PairResult result = lost_turn(lost_turn_params(GetParam()), {.one_way_ms = {20}});
  const auto suspended = result.of("suspended"), resumed = result.of("resumed");
  ASSERT_EQ(suspended.size(), 1u);
  ASSERT_EQ(resumed.size(), 1u);
  constexpr double kTransit_ns = 25e6;
  int before = 0, after = 0;
  for (const auto& sent : result.of("update_sent")) {
    const double when = time_of(sent);
    EXPECT_FALSE(when > time_of(suspended[0]) + kTransit_ns && when < time_of(resumed[0])) << sent;
    before += when < time_of(suspended[0]);
    after += when > time_of(resumed[0]);
  }
  EXPECT_GT(before, 0);
  EXPECT_GT(after, 0);
  for (const auto& applied : result.of("update_applied")) {
    const double when = time_of(applied);
    EXPECT_FALSE(when > time_of(suspended[0]) && when < time_of(resumed[0])) << applied;
  }
  // No update removes the place where the camera was relocalized.
  EXPECT_EQ(result.of("track_lost").size(), 1u);
}

TEST_P(FoundOnTheEdge, StartsNoTransferOfMapsOrKeyframesMeanwhile) {
  // A text keyframe takes longer over this link than making the next one, so some always wait.
  const PairResult result = lost_turn(lost_turn_params(GetParam(), "compatibility"),
                                      {.one_way_ms = {20}, .mbit_per_s = 4});
  const auto suspended = result.of("suspended"), resumed = result.of("resumed");
  ASSERT_EQ(suspended.size(), 1u);
  ASSERT_EQ(resumed.size(), 1u);
  double suspended_there = 0;
  for (const auto& message : result.of("message"))
    if (message["message"] == "SUSPEND") suspended_there = message["received_ns"];
  // A transfer starts with the announcement of its length; an announced message is in transfer.
  int waited = 0;
  for (const auto& message : result.of("message")) {
    const bool up = message["channel"] == "keyframe" && message["direction"] == "up";
    const bool down = message["channel"] == "map" && message["direction"] == "down";
    if ((!up && !down) || message["message"] != "ANNOUNCE") continue;
    const double sent = message["sent_ns"], end = time_of(resumed[0]);
    EXPECT_FALSE(sent > (up ? time_of(suspended[0]) : suspended_there) && sent < end) << message;
    waited += up && sent == end;
  }
  EXPECT_GT(waited, 0);
}

/// A slow edge, so that updates arrive that do not cover keyframes made before they began.
PairResult recovery_on_a_slow_edge(const char* map_update, bool keep) {
  auto params = lost_turn_params(map_update);
  params.update({{"n_kf", kPerUpdate}, {"sync_period_s", 0.3}, {"keep_recovery_keyframe", keep}});
  PairLink link{.one_way_ms = {20}};
  link.edge_device = testing::uniform_device(2000);
  link.edge_device->stages["insert"].a_us = 250'000;
  return lost_turn(params, link, same_place, 150);
}

/// Counts keyframes that the mobile lost in updates applied before the edge had mapped n_KF
/// keyframes made after the recovery.
int left_behind(const PairResult& result) {
  const double resumed = time_of(result.of("resumed").at(0));
  std::set<std::uint64_t> accepted;
  for (const auto& keyframe : result.of("keyframe_created"))
    if (time_of(keyframe) >= resumed) accepted.insert(keyframe["keyframe"].get<std::uint64_t>());
  for (const auto& declined : result.of("keyframe_declined"))
    accepted.erase(declined["keyframe"].get<std::uint64_t>());
  int updates = 0, behind = 0;
  for (const auto& applied : result.of("update_applied")) {
    const auto mapped = std::distance(
        accepted.begin(), accepted.upper_bound(applied["newest_keyframe"].get<std::uint64_t>()));
    if (time_of(applied) < resumed || mapped >= kPerUpdate) continue;
    ++updates;
    behind += applied["gap_keyframes"].get<int>();
  }
  EXPECT_GT(updates, 0);
  return behind;
}

/// Seconds from the recovery until the first update was sent.
double first_update_after_s(const PairResult& result) {
  const double resumed = time_of(result.of("resumed").at(0));
  double first = std::numeric_limits<double>::infinity();
  for (const auto& sent : result.of("update_sent"))
    if (time_of(sent) > resumed) first = std::min(first, time_of(sent) - resumed);
  return first / 1e9;
}

TEST_P(FoundOnTheEdge, UpdatesRestAfterARecoveryWhileTheyShowAnotherPlace) {
  const double kept = first_update_after_s(recovery_on_a_slow_edge(GetParam(), true));
  EXPECT_GE(kept, 2.0);
  EXPECT_LT(kept, 2.5);
  EXPECT_LT(first_update_after_s(recovery_on_a_slow_edge(GetParam(), false)), 1.9);
}

TEST_P(FoundOnTheEdge, AnUpdateThatLeftBeforeTheRecoveryIsDeclined) {
  // The update arrives during the loss.
  auto params = lost_turn_params(GetParam());
  params["sync_period_s"] = 0.3;
  const PairResult result = lost_turn(params, {.one_way_ms = {150}}, same_place);
  ASSERT_FALSE(result.of("resumed").empty());
  const double resumed = time_of(result.of("resumed")[0]);
  const auto declined = result.of("update_declined");
  EXPECT_TRUE(std::any_of(declined.begin(), declined.end(), [&](const auto& event) {
    return event["reason"] == "from before the recovery" && time_of(event) >= resumed;
  }));
}

TEST_P(FoundOnTheEdge, UpdatesLeaveNothingBehindThatWasMadeSinceTheRecovery) {
  EXPECT_EQ(left_behind(recovery_on_a_slow_edge(GetParam(), true)), 0);
  EXPECT_GT(left_behind(recovery_on_a_slow_edge(GetParam(), false)), 0);
}

INSTANTIATE_TEST_SUITE_P(Updates, FoundOnTheEdge, ::testing::Values("serial", "staged"));

/// A little more than a lap through a wrong lens, darkness, then the view from the middle of the
/// lap. The only update arrives before the edge can close the loop.
PairResult lap(bool loop_closing) {
  constexpr int kDarkAfterLap = 174, kBack = 80;
  const auto look = [](SyntheticScene& scene, int frame) {
    if (frame >= kDarkAfterLap && frame < kDarkAfterLap + kDarkFor) return scene.nothing();
    const int shown = frame < kDarkAfterLap ? frame : frame - kDarkAfterLap - kDarkFor + kBack;
    return testing::through_a_wrong_lens(scene, shown);
  };
  auto all = lost_turn_params("staged");
  all.update({{"sync_period_s", 13.0}, {"loop_closing", loop_closing}});
  return testing::run_pair(multithread_rl_system(), all, 195, 10, {.one_way_ms = {5}}, look);
}

/// Counts the keyframes from before the loss in the mobile's final map.
std::ptrdiff_t kept_from_before(const PairResult& result) {
  constexpr std::uint64_t kDarkAfterLap = 174;
  const auto& keyframes = result.mobile_map.keyframes;
  return std::count_if(keyframes.begin(), keyframes.end(), [](const NewKeyFrame& keyframe) {
    return keyframe.frame_index < kDarkAfterLap;
  });
}

TEST(EdgeRelocalizationAfterALoop, TheKeyframeTakesThePlaceOfTheOldWorld) {
  const PairResult closed = lap(true), open = lap(false);
  ASSERT_FALSE(closed.of("loop_closed").empty());
  EXPECT_TRUE(open.of("loop_closed").empty());
  for (const PairResult* result : {&closed, &open}) {
    ASSERT_EQ(result->of("track_lost").size(), 1u);
    ASSERT_EQ(result->of("relocalized").size(), 1u);
    EXPECT_EQ(result->of("relocalized")[0]["by"], "edge");
    EXPECT_EQ(result->of("frame_tracked").back()["state"], "ok");
    EXPECT_EQ(result->of("update_applied").size(), 1u);
  }
  EXPECT_LT(closed.of("loop_closed")[0]["t_ns"], closed.of("track_lost")[0]["t_ns"]);
  EXPECT_EQ(kept_from_before(closed), 1);
  EXPECT_GT(kept_from_before(open), 1);
}

TEST(EdgeRelocalizationAsText, SendsFramesAndKeyframesWhole) {
  const PairResult result =
      lost_turn(lost_turn_params("serial", "compatibility"), {.one_way_ms = {5}});
  const auto relocalized = result.of("relocalized");
  ASSERT_EQ(relocalized.size(), 1u);
  EXPECT_EQ(relocalized[0]["by"], "edge");
  std::map<std::string, double> largest;
  for (const auto& message : result.of("message")) {
    double& bytes = largest[message["message"]];
    bytes = std::max(bytes, message["bytes"].get<double>());
  }
  EXPECT_GT(largest["RELOC_FAIL"], 75e3);
  EXPECT_LT(largest["RELOC_FAIL"], 75.1e3);
  EXPECT_GT(largest["RELOC_REQUEST"], 100e3);
  EXPECT_GT(largest["RELOC_OK"], 2 * largest["RELOC_REQUEST"]);
}

}  // namespace
}  // namespace slambed
