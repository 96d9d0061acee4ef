// SPDX-License-Identifier: Apache-2.0
// DynNetSLAM's two nodes in virtual time on a synthetic world, under latencies that change.
#include "dynnetslam/dynnetslam.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "base/error.hpp"
#include "node/tests/virtual_pair.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed {
namespace {

using testing::PairLink;
using testing::PairResult;
using testing::pose_at;
using testing::SyntheticWorld;
using testing::turn;

constexpr double kFps = 10;
/// How far a keyframe of either map may be from where the camera was.
constexpr double kPositionTolerance_m = 0.02;

nlohmann::json params(bool hysteresis, bool safe_zone) {
  auto params = testing::enhanced();
  params.update({{"sync_period_s", 1.0},
                 {"fast_motion_ms", 0.0},
                 {"loop_closing", false},
                 {"hysteresis", hysteresis},
                 {"safe_zone", safe_zone},
                 {"l_ol_ms", 40.0},
                 {"l_sz_ms", -1.0},
                 {"b_ms", 10.0},
                 {"rtt_source", "tcp_info"},
                 {"mes_probe_hz", 10.0},
                 {"mes_probe_bytes", 64},
                 {"echo_hz", 4.0},
                 {"rtt_missing_s", 2.0},
                 {"decision_gap_s", 2.0},
                 {"handover_retry_s", 2.0}});
  return params;
}

PairResult run(const nlohmann::json& parameters, int frames, const PairLink& link,
               testing::WorldSource::Look look = turn) {
  return testing::run_pair(dynnetslam_system(), parameters, frames, kFps, link, std::move(look));
}

/// RTTs in ms, each for so many seconds.
PairLink steps(const std::vector<std::pair<double, double>>& rtts) {
  PairLink link{.one_way_ms = {}, .step_s = 0.1};
  for (const auto& [rtt_ms, seconds] : rtts)
    link.one_way_ms.insert(link.one_way_ms.end(), static_cast<std::size_t>(seconds * 10),
                           rtt_ms / 2);
  return link;
}

/// Up in a straight line and down again.
PairLink ramp(double peak_rtt_ms, double half_s) {
  PairLink link{.one_way_ms = {}, .step_s = 0.1};
  const int half = static_cast<int>(half_s * 10);
  for (int i = 0; i <= 2 * half; ++i)
    link.one_way_ms.push_back(peak_rtt_ms / 2 * (1 - std::abs(i - half) / double(half)));
  return link;
}

std::string states(const PairResult& result) {
  std::string text;
  for (const auto& event : result.of("state_changed")) {
    if (!text.empty()) text += ' ';
    text += event["to"].get<std::string>();
  }
  return text;
}

void expect_all_tracked(const PairResult& result, int frames) {
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.of("frame_tracked").size() + result.of("frame_dropped").size(),
            static_cast<std::size_t>(frames));
  EXPECT_TRUE(result.of("track_lost").empty());
  EXPECT_TRUE(result.of("warning").empty());
}

/// Every keyframe where the camera was, every observation of a point that is there, no point that
/// nothing sees.
void expect_consistent(const MapDelta& map) {
  std::set<MapPointId> points, seen;
  for (const NewPoint& point : map.points) points.insert(point.id);
  for (const NewKeyFrame& keyframe : map.keyframes) {
    const SE3 truth = pose_at(static_cast<int>(keyframe.frame_index)) * pose_at(0).inverse();
    const Eigen::Vector3d error = keyframe.T_cw.inverse().t - truth.inverse().t;
    EXPECT_LT(error.norm(), kPositionTolerance_m) << "frame " << keyframe.frame_index;
    for (const MapPointId id : keyframe.points) {
      if (!id) continue;
      EXPECT_TRUE(points.contains(id));
      seen.insert(id);
    }
  }
  EXPECT_EQ(seen.size(), points.size());
}

/// No map that the edge made in an older epoch was taken over; times in ns.
void expect_no_stale_update(const PairResult& result) {
  std::map<std::uint64_t, double> epoch_ends;  // when epoch n was over
  for (const auto& event : result.of("state_changed")) {
    if (event["to"] == "MES") epoch_ends[event["epoch"].get<std::uint64_t>() - 1] = event["t_ns"];
  }
  std::map<std::uint64_t, std::uint64_t> epoch_of;
  for (const auto& event : result.of("update_sent"))
    epoch_of[event["update"].get<std::uint64_t>()] = event["epoch"].get<std::uint64_t>();
  for (const auto& event : result.of("update_applied")) {
    const auto end = epoch_ends.find(epoch_of.at(event["update"].get<std::uint64_t>()));
    if (end != epoch_ends.end()) {
      EXPECT_LE(event["t_ns"].get<double>(), end->second);
    }
  }
}

/// Keyframes mapped on a node while the state was this one, a second after it began.
int mapped_in(const PairResult& result, const std::vector<nlohmann::json>& side,
              const std::string& state) {
  const auto changes = result.of("state_changed");
  int mapped = 0;
  for (const auto& event : side) {
    if (event["type"] != "keyframe_mapped") continue;
    std::string now;
    for (const auto& change : changes)
      if (change["t_ns"].get<double>() + 1e9 < event["t_ns"].get<double>()) now = change["to"];
      else if (change["t_ns"].get<double>() < event["t_ns"].get<double>()) now = "just changed";
    mapped += now == state ? 1 : 0;
  }
  return mapped;
}

TEST(DynNetSlam, TheSafeZoneLeadsToTheMobileSideAndBack) {
  const PairResult result = run(params(true, true), 420, ramp(60, 20));
  EXPECT_EQ(states(result), "OS SZ MES SZ OS");
  expect_all_tracked(result, 420);
  expect_consistent(result.edge_map);
  expect_consistent(result.mobile_map);
  expect_no_stale_update(result);
  EXPECT_EQ(mapped_in(result, result.mobile, "OS"), 0);
  EXPECT_GT(mapped_in(result, result.mobile, "SZ"), 0);
  EXPECT_GT(mapped_in(result, result.mobile, "MES"), 0);
  EXPECT_GT(mapped_in(result, result.edge, "OS"), 0);
  EXPECT_GT(mapped_in(result, result.edge, "SZ"), 0);
  EXPECT_EQ(mapped_in(result, result.edge, "MES"), 0);
  EXPECT_EQ(result.of("handover_sent").size(), 1u);
  EXPECT_EQ(result.of("handover_applied").size(), 1u);
}

TEST(DynNetSlam, WithoutASafeZoneTheMapGoesOverAtOnce) {
  for (const bool hysteresis : {false, true}) {
    const PairResult result = run(params(hysteresis, false), 420, ramp(60, 20));
    EXPECT_EQ(states(result), "OS MES OS");
    expect_all_tracked(result, 420);
    expect_consistent(result.edge_map);
    expect_consistent(result.mobile_map);
    expect_no_stale_update(result);
    EXPECT_GT(mapped_in(result, result.mobile, "MES"), 0);
    EXPECT_EQ(mapped_in(result, result.edge, "MES"), 0);
    EXPECT_EQ(mapped_in(result, result.mobile, "OS"), 0);
  }
}

TEST(DynNetSlam, TheEdgeKnowsEveryKeyframeAfterAHandover) {
  const PairResult result = run(params(false, false), 300, steps({{20, 8}, {80, 10}, {20, 20}}));
  ASSERT_EQ(states(result), "OS MES OS");
  const auto changes = result.of("state_changed");
  std::set<std::uint64_t> made, culled_or_there;
  for (const auto& event : result.of("keyframe_created")) {
    const double t = event["t_ns"];
    if (t > changes[1]["t_ns"].get<double>() && t < changes[2]["t_ns"].get<double>())
      made.insert(event["keyframe"].get<std::uint64_t>());
  }
  ASSERT_GT(made.size(), 5u);
  int there = 0;
  for (const NewKeyFrame& keyframe : result.edge_map.keyframes) there += made.contains(keyframe.id.value);
  EXPECT_GT(there, static_cast<int>(made.size()) / 2);  // others were culled as redundant
}

TEST(DynNetSlam, AStartUnderHighLatencyNeedsAWholeHandover) {
  const PairResult result = run(params(true, true), 300, steps({{70, 10}, {10, 30}}));
  EXPECT_EQ(states(result), "MES SZ OS");
  expect_all_tracked(result, 300);
  const auto sent = result.of("handover_sent");
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0]["whole"], true);
  expect_consistent(result.edge_map);
  EXPECT_GT(result.of("update_applied").size(), 0u);
}

TEST(DynNetSlam, AnUpdateOfAnOlderEpochIsDeclined) {
  auto parameters = params(true, false);
  parameters["sync_period_s"] = 0.0;
  parameters["l_ol_ms"] = 1000.0;
  parameters["b_ms"] = 200.0;
  // At such latencies some update is always under way.
  const PairResult result = run(parameters, 200, steps({{800, 8}, {1300, 20}}));
  EXPECT_EQ(states(result), "OS MES");
  int stale = 0;
  for (const auto& event : result.of("update_declined")) stale += event["reason"] == "older epoch";
  EXPECT_GT(stale, 0);
  expect_no_stale_update(result);
  expect_consistent(result.mobile_map);
}

TEST(DynNetSlam, AWayThatIsCutLeadsToTheMobileSideAndBack) {
  PairLink link;
  link.one_way_ms = {5};
  link.gaps = {{8'000'000'000, 13'000'000'000}};
  for (const bool safe_zone : {false, true}) {
    const PairResult result = run(params(true, safe_zone), 300, link);
    EXPECT_EQ(states(result), safe_zone ? "OS SZ MES SZ OS" : "OS MES OS");
    expect_all_tracked(result, 300);
    expect_consistent(result.edge_map);
    expect_no_stale_update(result);
  }
}

TEST(DynNetSlam, AStandingCameraIsNoTrap) {
  const auto stand = [](SyntheticWorld& world, int frame) { return turn(world, std::min(frame, 30)); };
  const PairResult result = run(params(true, true), 300, steps({{10, 3}, {90, 9}, {10, 18}}), stand);
  EXPECT_EQ(states(result), "OS SZ MES SZ OS");
  expect_all_tracked(result, 300);
}

TEST(DynNetSlam, TheEchoServesAsRttToo) {
  auto parameters = params(true, false);
  parameters["rtt_source"] = "echo";
  parameters["echo_hz"] = 10.0;
  const PairResult result = run(parameters, 420, ramp(60, 20));
  EXPECT_EQ(states(result), "OS MES OS");
  expect_all_tracked(result, 420);
}

TEST(DynNetSlam, TheProfileServesAsRttWhateverThePathDoes) {
  auto parameters = params(true, true);
  parameters["rtt_source"] = "profile";
  PairLink link;
  link.one_way_ms = {1};
  const PairLink asked = ramp(60, 20);
  link.profile_rtt = RttTable{.step = std::chrono::milliseconds(100), .values = {}};
  for (const double ms : asked.one_way_ms)
    link.profile_rtt->values.push_back(from_seconds(2 * ms / 1000));
  const PairResult result = run(parameters, 420, link);
  EXPECT_EQ(states(result), "OS SZ MES SZ OS");
  expect_all_tracked(result, 420);
  for (const auto& event : result.of("state_changed")) {
    const RunTime when(event["t_ns"].get<std::int64_t>());
    EXPECT_NEAR(event["rtt_ms"].get<double>(), to_ms(link.profile_rtt->at(when)), 0.05);
  }
  link.profile_rtt.reset();
  EXPECT_THROW(run(parameters, 10, link), Error);
}

TEST(DynNetSlam, AProfileDoesNotHideALostEdge) {
  auto parameters = params(true, false);
  parameters["rtt_source"] = "profile";
  PairLink link;
  link.one_way_ms = {5};
  link.gaps = {{8'000'000'000, 13'000'000'000}};
  link.profile_rtt = RttTable{.step = std::chrono::seconds(1), .values = {from_seconds(0.01)}};
  const PairResult result = run(parameters, 300, link);
  EXPECT_EQ(states(result), "OS MES OS");
  expect_all_tracked(result, 300);
}

TEST(DynNetSlam, TheSameSeedGivesTheSameBytes) {
  const auto once = [] { return run(params(true, true), 200, ramp(60, 8)); };
  const PairResult first = once(), second = once();
  EXPECT_EQ(first.mobile_text, second.mobile_text);
  EXPECT_EQ(first.edge_text, second.edge_text);
  EXPECT_EQ(first.trajectory, second.trajectory);
}

TEST(DynNetSlam, TwoHundredSwitchesLeaveEverythingInOrder) {
  constexpr int kFrames = 3300;
  std::vector<std::pair<double, double>> rtts;
  for (int i = 0; i < 110; ++i) {
    rtts.push_back({5, 1.5});
    rtts.push_back({120, 1.5});
  }
  const PairResult result = run(params(false, false), kFrames, steps(rtts));
  EXPECT_GE(result.of("state_changed").size(), 200u);
  expect_all_tracked(result, kFrames);
  expect_no_stale_update(result);
  expect_consistent(result.edge_map);
  expect_consistent(result.mobile_map);
  // The room is seen over and over, and Edge-SLAM maps it again each time. The switches add to
  // that no more than a few redundant elements.
  const PairResult unswitched = run(params(false, false), kFrames, steps({{5, 1}}));
  EXPECT_EQ(states(unswitched), "OS");
  EXPECT_LT(result.edge_counts.keyframes, 1.5 * unswitched.edge_counts.keyframes);
  EXPECT_LT(result.edge_counts.points, 1.5 * unswitched.edge_counts.points);
  double largest = 0;
  for (const auto& event : result.of("handover_sent"))
    largest = std::max(largest, event["bytes"].get<double>());
  EXPECT_LT(largest, 2e6);
}

}  // namespace
}  // namespace slambed
