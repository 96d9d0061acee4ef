// SPDX-License-Identifier: Apache-2.0
// Hand-overs of the map to the edge: whole, as changes, and repeated.
#include <random>

#include "dynnetslam/tests/switching_pair.hpp"
#include "geometry/tests/draws.hpp"
#include "wire/handover_messages.hpp"

namespace slambed::testing {
namespace {

TEST_P(DynNetSlam, TheEdgeKnowsEveryKeyframeAfterAHandover) {
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
  for (const NewKeyFrame& keyframe : result.edge_map.keyframes)
    there += made.contains(keyframe.id.value);
  EXPECT_GT(there, static_cast<int>(made.size()) / 2);  // others were culled as redundant
}

TEST_P(DynNetSlam, AStartUnderHighLatencyNeedsAWholeHandover) {
  const PairResult result = run(params(true, true), 300, steps({{70, 10}, {10, 30}}));
  EXPECT_EQ(states(result), "MES SZ OS");
  expect_all_tracked(result, 300);
  const auto sent = result.of("handover_sent");
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0]["whole"], true);
  expect_consistent(result.edge_map);
  EXPECT_GT(result.of("update_applied").size(), 0u);
}

TEST_P(DynNetSlam, TwoHundredSwitchesLeaveEverythingInOrder) {
  constexpr int kFrames = 3300;
  std::vector<std::pair<double, double>> rtts;
  for (int i = 0; i < 110; ++i) {
    rtts.push_back({5, 1.5});
    rtts.push_back({120, 1.5});
  }
  const PairResult result = run(params(false, false), kFrames, steps(rtts));
  // Over the slow link the RTT changes later, and not always far enough.
  EXPECT_GE(result.of("state_changed").size(), fitted() ? 80u : 200u);
  expect_all_tracked(result, kFrames);
  expect_no_stale_update(result);
  expect_consistent(result.edge_map);
  expect_consistent(result.mobile_map);
  // The camera sees the room repeatedly, and Edge-SLAM maps it again each time. The switches add
  // only a few redundant elements.
  const PairResult unswitched = run(params(false, false), kFrames, steps({{5, 1}}));
  EXPECT_EQ(states(unswitched), "OS");
  EXPECT_LT(result.edge_counts.keyframes, 1.5 * unswitched.edge_counts.keyframes);
  EXPECT_LT(result.edge_counts.points, 1.5 * unswitched.edge_counts.points);
  double largest = 0;
  for (const auto& event : result.of("handover_sent"))
    largest = std::max(largest, event["bytes"].get<double>());
  EXPECT_LT(largest, 2e6);
}

TEST(DynNetSlamHandover, OneThatTheEdgeCannotReadIsNotWaitedForForEver) {
  PairLink link = steps({{20, 8}, {80, 10}, {20, 20}});
  int torn = 0;
  link.alter_handovers = [&torn](Message& message) {
    if (message.type == wire::type_of(wire::MapHandover::kType) && torn < 2) {
      ++torn;
      message.payload.pop_back();
    }
    return true;
  };
  const PairResult result = testing::run_pair(
      dynnetslam_system(), params(false, false), 300, kFps, link,
      [](SyntheticScene& scene, int frame) { return scene.look(pose_at(frame)); });
  ASSERT_EQ(states(result), "OS MES OS");
  const auto sent = result.of("handover_sent");
  const auto answered = result.of("handover_acknowledged");
  ASSERT_EQ(sent.size(), 3u);
  ASSERT_EQ(answered.size(), 3u);
  EXPECT_EQ(sent[0]["whole"], false);
  EXPECT_EQ(sent[1]["whole"], true);
  // A whole map that was declined is not sent again at once.
  EXPECT_GE(sent[2]["t_ns"].get<double>(), answered[1]["t_ns"].get<double>() + 2e9);
  EXPECT_EQ(answered[1]["accepted"], false);
  EXPECT_EQ(answered[2]["accepted"], true);
  EXPECT_GT(mapped_in(result, result.edge, "OS"), 0);
  EXPECT_EQ(result.of("warning").size(), 2u) << "two that could not be read";
}

TEST(DynNetSlamSingleCamera, BothKeyFramesOfItsFirstMapAreMappedHereAndGoOver) {
  for (const double first_rtt_ms : {5, 70}) {
    auto parameters = params(false, false);
    parameters.update({{"n_kf", 6}, {"sync_period_s", 0.0}});
    PairLink link = steps({{first_rtt_ms, 5}, {5, 30}});
    link.single_camera = true;
    const PairResult result =
        run_pair(dynnetslam_system(), parameters, 450, 30, link,
                 [](SyntheticScene& scene, int frame) { return scene.look(stroll_round(frame)); });
    EXPECT_EQ(states(result), first_rtt_ms > 40 ? "MES OS" : "OS");
    expect_all_tracked(result, 450);
    EXPECT_EQ(result.of("initialized").size(), 1u);
    std::set<std::uint64_t> mapped;
    for (const auto& event : result.of("keyframe_mapped"))
      mapped.insert(event["keyframe"].get<std::uint64_t>());
    const auto created = result.of("keyframe_created");
    ASSERT_GT(created.size(), 2u);
    ASSERT_EQ(created[0]["t_ns"], created[1]["t_ns"]);
    EXPECT_TRUE(mapped.contains(created[1]["keyframe"].get<std::uint64_t>()));
    EXPECT_EQ(mapped.contains(created[0]["keyframe"].get<std::uint64_t>()), first_rtt_ms > 40);
    EXPECT_FALSE(result.of("update_applied").empty());
  }
}

/// Along an endless wall at 3.4 m/s, where every meter looks new.
std::shared_ptr<const FeatureSet> along_the_wall(SyntheticScene& scene, int frame) {
  constexpr double kStep_m = 0.34;
  constexpr int kPerMeter = 220, kView_m = 3;
  const auto sensor = scene.sensor();
  const double camera_m = kStep_m * frame;
  std::vector<KeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
  for (int meter = static_cast<int>(camera_m) - kView_m; meter <= camera_m + kView_m; ++meter) {
    std::mt19937_64 random(static_cast<std::uint64_t>(meter + 100));
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < kPerMeter; ++i) {
      const Eigen::Vector3d at = drawn<3>([&] { return unit(random); });
      const Eigen::Vector3d p(meter + at.x() - camera_m, 3.2 * at.y() - 1.6, 2 + 1.5 * at.z());
      const double reach_m = 4 + 9 * unit(random);
      KeyPoint seen;
      seen.angle_deg = static_cast<float>(359 * unit(random));
      Descriptor descriptor{};
      for (auto& word : descriptor) word = random();
      const Eigen::Vector2d uv = sensor->camera.project(p);
      const double octave = std::round(std::log(reach_m / p.norm()) / std::log(1.2));
      if (!sensor->bounds.contains(uv.x(), uv.y()) || octave < 0 || octave > 7) continue;
      seen.u = static_cast<float>(uv.x());
      seen.v = static_cast<float>(uv.y());
      seen.octave = static_cast<std::uint8_t>(octave);
      seen.depth_m = static_cast<float>(p.z());
      seen.right_u = static_cast<float>(uv.x() - sensor->camera.bf / p.z());
      keypoints.push_back(seen);
      descriptors.push_back(descriptor);
    }
  }
  return std::make_shared<FeatureSet>(sensor, std::move(keypoints), std::move(descriptors));
}

TEST(DynNetSlamHandover, ALargeMapOverASlowLinkIsSentOnce) {
  constexpr int kFrames = 1530;
  PairLink link = steps({{80, 126}, {10, 1}});
  link.mbit_per_s = 10;
  link.edge_device = testing::fitted_device(SLAMBED_DEVICES, "edge_i7_6700t");
  const PairResult result = testing::run_pair(dynnetslam_system(), params(false, false), kFrames,
                                              kFps, link, along_the_wall);
  EXPECT_EQ(states(result), "MES OS");
  expect_all_tracked(result, kFrames);
  const auto sent = result.of("handover_sent");
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_GE(sent[0]["keyframes"].get<int>(), 200);
  EXPECT_GE(sent[0]["bytes"].get<double>(), 6e6);
  const auto acknowledged = result.of("handover_acknowledged");
  ASSERT_EQ(acknowledged.size(), 1u);
  EXPECT_EQ(acknowledged[0]["accepted"], true);
  EXPECT_GT(acknowledged[0]["handover_ms"].get<double>(), 5000);
  // Then the mobile stops mapping, sends deferred keyframes, and the edge maps them.
  const double taken = acknowledged[0]["t_ns"];
  std::vector<std::uint64_t> made;
  for (const auto& event : result.mobile) {
    const double t = event["t_ns"];
    if (event["type"] == "keyframe_mapped") {
      EXPECT_LT(t, taken + 1e9);
    }
    if (event["type"] == "keyframe_created" && t > sent[0]["t_ns"].get<double>() && t < taken)
      made.push_back(event["keyframe"]);
  }
  EXPECT_GT(made.size(), 5u);
  std::set<std::uint64_t> heard;
  for (const auto& event : result.edge) {
    if (event["type"] == "keyframe_received" || event["type"] == "keyframe_declined")
      heard.insert(event["keyframe"].get<std::uint64_t>());
  }
  for (const std::uint64_t keyframe : made) EXPECT_TRUE(heard.contains(keyframe)) << keyframe;
  EXPECT_GT(mapped_in(result, result.edge, "OS"), 0);
}

}  // namespace
}  // namespace slambed::testing
