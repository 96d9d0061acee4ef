// SPDX-License-Identifier: Apache-2.0
// DynNetSLAM's two nodes in virtual time on a synthetic scene, under latencies that change.
#include "dynnetslam/tests/switching_pair.hpp"

namespace slambed::testing {
namespace {

INSTANTIATE_TEST_SUITE_P(Worlds, DynNetSlam, ::testing::Values(World::kUniform, World::kFitted),
                         [](const auto& scene) {
                           return scene.param == World::kUniform ? "Uniform" : "Fitted";
                         });

TEST_P(DynNetSlam, TheSafeZoneLeadsToTheMobileSideAndBack) {
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
  // On fitted devices the safe zone ends before a keyframe is mapped.
  if (!fitted()) {
    EXPECT_GT(mapped_in(result, result.edge, "SZ"), 0);
  }
  EXPECT_EQ(mapped_in(result, result.edge, "MES"), 0);
  EXPECT_EQ(result.of("handover_sent").size(), 1u);
  EXPECT_EQ(result.of("handover_applied").size(), 1u);
}

TEST_P(DynNetSlam, WithoutASafeZoneTheMapGoesOverAtOnce) {
  for (const bool hysteresis : {false, true}) {
    const PairResult result = run(params(hysteresis, false), 420, ramp(60, 20));
    EXPECT_EQ(states(result), "OS MES OS");
    expect_all_tracked(result, 420);
    expect_consistent(result.edge_map);
    expect_consistent(result.mobile_map);
    expect_no_stale_update(result);
    EXPECT_GT(mapped_in(result, result.mobile, "MES"), 0);
    EXPECT_EQ(mapped_in(result, result.edge, "MES"), 0);
    // The mobile maps until the edge has accepted the map, and finishes what it has begun.
    const double taken = result.of("handover_acknowledged").at(0)["t_ns"];
    const double again = result.of("state_changed").back()["t_ns"];
    for (const auto& event : result.mobile) {
      const double t = event["t_ns"];
      if (event["type"] == "keyframe_mapped" && t > again) {
        EXPECT_LT(t, taken + 1.5e9);
      }
    }
  }
}

TEST_P(DynNetSlam, AnUpdateOfAnOlderEpochIsDeclined) {
  auto parameters = params(true, false);
  parameters["sync_period_s"] = 0.0;
  parameters["l_ol_ms"] = 1000.0;
  parameters["b_ms"] = 200.0;
  // At such latencies some update is always in transit.
  const PairResult result = run(parameters, 200, testing::steps({{800, 8}, {1300, 20}}));
  EXPECT_EQ(states(result), "OS MES");
  int stale = 0;
  for (const auto& event : result.of("update_declined")) stale += event["reason"] == "older epoch";
  EXPECT_GT(stale, 0);
  expect_no_stale_update(result);
  expect_consistent(result.mobile_map);
}

TEST_P(DynNetSlam, AStandingCameraIsNoTrap) {
  const auto stand = [](SyntheticScene& scene, int frame) {
    return turn(scene, std::min(frame, 30));
  };
  const PairResult result =
      run(params(true, true), 300, steps({{10, 3}, {90, 9}, {10, 18}}), stand);
  EXPECT_EQ(states(result), "OS SZ MES SZ OS");
  expect_all_tracked(result, 300);
}

TEST_P(DynNetSlam, TheSameSeedGivesTheSameBytes) {
  const auto once = [&] { return run(params(true, true), 200, ramp(60, 8)); };
  const PairResult first = once(), second = once();
  EXPECT_EQ(first.mobile_text, second.mobile_text);
  EXPECT_EQ(first.edge_text, second.edge_text);
  EXPECT_EQ(first.trajectory, second.trajectory);
}

}  // namespace
}  // namespace slambed::testing
