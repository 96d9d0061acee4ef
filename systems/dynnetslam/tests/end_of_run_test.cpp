// SPDX-License-Identifier: Apache-2.0
// Whose poses the final trajectory uses, depending on where the run ends.
#include "dynnetslam/tests/switching_pair.hpp"

namespace slambed::testing {
namespace {

constexpr double kSamePosition_m = 1e-9;

PairResult run_to_the_end(const PairLink& link, int frames) {
  auto parameters = testing::params(false, false);
  parameters["n_kf"] = 12;  // only some of the mobile's keyframes are references of frames
  parameters["decision_gap_s"] = 4.0;
  return testing::run_pair(
      dynnetslam_system(), parameters, frames, kFps, link,
      [](SyntheticScene& scene, int frame) { return scene.look(pose_at(frame)); });
}

/// Counts this map's keyframes that frames refer to, and those the trajectory places elsewhere.
std::pair<int, int> placed_elsewhere(const PairResult& result, const MapDelta& map) {
  int known = 0, elsewhere = 0;
  for (const NewKeyFrame& keyframe : map.keyframes) {
    const auto placed = result.keyframe_poses.find(keyframe.id);
    if (placed == result.keyframe_poses.end()) continue;
    ++known;
    elsewhere += (placed->second.inverse().t - keyframe.T_cw.inverse().t).norm() > kSamePosition_m;
  }
  return {known, elsewhere};
}

TEST(EndOfRun, WhereTheEdgeMapsItsPosesCount) {
  const PairResult result = run_to_the_end(steps({{20, 30}}), 200);
  ASSERT_EQ(states(result), "OS");
  ASSERT_TRUE(result.of("warning").empty());
  const auto [known, elsewhere] = placed_elsewhere(result, result.edge_map);
  EXPECT_GT(known, 10);
  EXPECT_EQ(elsewhere, 0);
}

TEST(EndOfRun, WithoutItsEdgeTheMobilesOwnMapCounts) {
  PairLink link = steps({{20, 30}});
  link.gaps = {{19'500'000'000, 90'000'000'000}};
  const PairResult result = run_to_the_end(link, 200);
  ASSERT_EQ(states(result), "OS") << "nobody noticed before the end";
  ASSERT_EQ(result.of("warning").size(), 1u) << "the shutdown was answered";
  const auto [known, elsewhere] = placed_elsewhere(result, result.mobile_map);
  EXPECT_GT(known, 3);
  EXPECT_EQ(elsewhere, 0);
}

TEST(EndOfRun, WhileTheMapGoesOverTheMobilesOwnCounts) {
  PairLink link = steps({{10, 8}, {80, 12}, {10, 30}});
  link.mbit_per_s = 20;
  const PairResult result = run_to_the_end(link, 210);
  ASSERT_EQ(states(result), "OS MES OS");
  ASSERT_EQ(result.of("handover_sent").size(), 1u);
  const double sent = result.of("handover_sent")[0]["t_ns"];
  double last_frame = 0;
  for (const auto& frame : result.of("frame_tracked")) last_frame = frame["t_ns"];
  ASSERT_LT(sent, last_frame);
  for (const auto& answer : result.of("handover_acknowledged"))
    ASSERT_GT(answer["t_ns"].get<double>(), last_frame) << "the edge had the map before the end";
  const auto [known, elsewhere] = placed_elsewhere(result, result.mobile_map);
  EXPECT_GT(known, 10);
  EXPECT_EQ(elsewhere, 0);
  EXPECT_EQ(result.mobile_counts.keyframes, result.mobile_map.keyframes.size());
}

}  // namespace
}  // namespace slambed::testing
