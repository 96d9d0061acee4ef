// SPDX-License-Identifier: Apache-2.0
// Loops in a drifting map: detection, verification, correction, pose graph and global bundle.
#include <gtest/gtest.h>

#include "drifted_laps.hpp"
#include "slam/essential_graph.hpp"
#include "slam/global_bundle.hpp"
#include "slam/loop_closer.hpp"
#include "slam/loop_correction.hpp"
#include "slam/map_correction.hpp"

namespace slambed::testing {
namespace {

/// Adds keyframes until a loop is verified.
bool run_to_loop(DriftedLaps& laps, LoopCloser& closer, int limit) {
  while (laps.count() < limit)
    if (closer.detect(laps.add()) && closer.verify()) return true;
  return false;
}

struct Case {
  const char* name;
  DriftedLaps::Drift drift;
  double closed_m;    ///< worst error allowed after the graph
  double polished_m;  ///< the same after the bundle
};
void PrintTo(const Case& test, std::ostream* out) { *out << test.name; }

class LoopTest : public ::testing::TestWithParam<Case> {
 protected:
  LoopTest() : laps(GetParam().drift), closer({}, laps.map, laps.places) {}
  DriftedLaps laps;
  LoopCloser closer;
};

TEST_P(LoopTest, IsFoundWhereTheLapCloses) {
  ASSERT_TRUE(run_to_loop(laps, closer, 2 * DriftedLaps::kPerLap));
  // The loop can close half a field of view before the end of the lap; the rest is a margin.
  EXPECT_GE(laps.count(), DriftedLaps::kPerLap - 8);
  EXPECT_LE(laps.count(), DriftedLaps::kPerLap + 8);
  const LoopMatch& loop = closer.loop();
  EXPECT_EQ(loop.keyframe, DriftedLaps::id(laps.count() - 1));
  EXPECT_LE(loop.matched, DriftedLaps::id(12));
  EXPECT_GE(loop.matches, 40);
  // The old part of the map is accurate, so the new keyframe's corrected pose must be too.
  const SE3 found = to_se3(loop.S_cw);
  const int k = laps.count() - 1;
  const int old = static_cast<int>(loop.matched.value & 0xffff) - 1;
  const SE3 expected = DriftedLaps::truth(k) * DriftedLaps::truth(old).inverse() * laps.pose(old);
  EXPECT_LT(center_error(found, expected), 0.06);
  EXPECT_LT(turn_error_deg(found, expected), 1.5);
  EXPECT_GT(center_error(laps.pose(k), expected), 0.15)
      << "without drift there is nothing to close";
}

TEST_P(LoopTest, CorrectionGraphAndBundleBringTheMapHome) {
  ASSERT_TRUE(run_to_loop(laps, closer, 2 * DriftedLaps::kPerLap));
  const double drifted_m = laps.worst_error_m();
  ASSERT_GT(drifted_m, 0.15);
  const auto points = [&] {
    return laps.map->read([](const MapView& view) { return view.point_count(); });
  };
  const std::size_t points_before = points();

  const MapDelta correction = closer.correct();
  EXPECT_GT(correction.fusions.size(), 30u);
  laps.map->commit(correction);
  EXPECT_LT(points(), points_before);
  EXPECT_LT(laps.error_m(laps.count() - 1), 0.06);
  laps.map->read([&](const MapView& view) {
    const auto& near = view.keyframe(closer.loop().keyframe)->covisibles;
    EXPECT_TRUE(std::any_of(near.begin(), near.end(),
                            [&](const Covisible& c) { return c.id == closer.loop().matched; }));
    return 0;
  });

  ASSERT_TRUE(closer.begin_graph());
  int steps = 0;
  while (closer.step_graph()) ++steps;
  EXPECT_GE(steps, 1);
  laps.map->commit(closer.finish_graph());
  EXPECT_LT(laps.worst_error_m(), GetParam().closed_m);
  EXPECT_EQ(laps.error_m(0), 0) << "the origin never moves";

  ASSERT_TRUE(closer.begin_bundle());
  while (closer.step_bundle()) {
  }
  laps.map->commit(closer.finish_bundle());
  EXPECT_LT(laps.worst_error_m(), GetParam().polished_m);
  EXPECT_EQ(laps.error_m(0), 0);
}

TEST_P(LoopTest, TheNextLapStaysQuietAndTrue) {
  ASSERT_TRUE(run_to_loop(laps, closer, 2 * DriftedLaps::kPerLap));
  laps.map->commit(closer.correct());
  for (int i = 1; i < 10; ++i) EXPECT_FALSE(closer.detect(laps.add())) << i;
}

INSTANTIATE_TEST_SUITE_P(
    Drifts, LoopTest,
    ::testing::Values(Case{"rigid", {}, 0.12, 0.05},
                      Case{"turning", {.turn_rad = 0.006, .move_m = 0.001}, 0.15, 0.05},
                      Case{"mono",
                           {.turn_rad = 0.002, .move_m = 0.002, .scale = 0.004, .mono = true},
                           0.12,
                           0.08}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(LoopDetection, OneLapWithoutReturnHasNoLoop) {
  DriftedLaps laps({});
  LoopCloser closer({}, laps.map, laps.places);
  EXPECT_FALSE(run_to_loop(laps, closer, 45));
  EXPECT_FALSE(closer.begin_graph());
  EXPECT_FALSE(closer.step_graph());
  EXPECT_TRUE(closer.finish_graph().empty());
  EXPECT_FALSE(closer.step_bundle());
  EXPECT_TRUE(closer.finish_bundle().empty());
}

TEST(LoopDetection, UnknownAndCulledKeyFramesAreIgnored) {
  DriftedLaps laps({});
  LoopCloser closer({}, laps.map, laps.places);
  EXPECT_FALSE(closer.detect(DriftedLaps::id(7)));
  EXPECT_FALSE(closer.verify());
  ASSERT_TRUE(run_to_loop(laps, closer, 2 * DriftedLaps::kPerLap));
  MapDelta cull;
  cull.culled_keyframes = {closer.loop().matched};
  laps.map->commit(cull);
  EXPECT_TRUE(closer.correct().empty());
  EXPECT_FALSE(closer.begin_graph());
}

TEST(LoopDetection, AnotherMapMakesItForget) {
  DriftedLaps laps({});
  LoopCloser closer({}, laps.map, laps.places);
  ASSERT_TRUE(run_to_loop(laps, closer, 2 * DriftedLaps::kPerLap));
  closer.correct();
  closer.replace_map(std::make_shared<Map>());
  EXPECT_FALSE(closer.begin_graph());
  EXPECT_FALSE(closer.begin_bundle()) << "nothing to adjust";
}

TEST(LoopClosing, EqualRunsGiveEqualMaps) {
  std::vector<SE3> poses[2];
  for (auto& list : poses) {
    DriftedLaps laps({});
    LoopCloser closer({}, laps.map, laps.places);
    ASSERT_TRUE(run_to_loop(laps, closer, 2 * DriftedLaps::kPerLap));
    laps.map->commit(closer.correct());
    closer.begin_graph();
    while (closer.step_graph()) {
    }
    laps.map->commit(closer.finish_graph());
    for (int k = 0; k < laps.count(); ++k) list.push_back(laps.pose(k));
  }
  ASSERT_EQ(poses[0].size(), poses[1].size());
  for (std::size_t k = 0; k < poses[0].size(); ++k) {
    EXPECT_EQ(poses[0][k].t, poses[1][k].t);
    EXPECT_EQ(poses[0][k].R, poses[1][k].R);
  }
}

TEST(LoopVerification, OtherPlacesAreRefused) {
  DriftedLaps laps({});
  for (int i = 0; i < 40; ++i) laps.add();
  laps.places->update_from(*laps.map);
  LoopVerifier verifier({}, laps.places);
  for (const int other : {0, 3, 10, 15})
    EXPECT_FALSE(verifier.verify(*laps.map, DriftedLaps::id(39), DriftedLaps::id(other))) << other;
  EXPECT_FALSE(verifier.verify(*laps.map, DriftedLaps::id(39), DriftedLaps::id(99)));
  EXPECT_TRUE(verifier.verify(*laps.map, DriftedLaps::id(39), DriftedLaps::id(37)));
}

TEST(MapCorrectionTest, TheUnmentionedFollowTheirParentsAndPointsTheirKeyFrames) {
  DriftedLaps laps({});
  for (int i = 0; i < 6; ++i) laps.add();
  Vector7 twist;
  twist << 0.3, -0.2, 0.1, 0.2, 0.1, -0.3, 0.4;
  const Sim3 change = sim3_exp(twist);  // of the world, including its scale
  const MapDelta delta = laps.map->read([&](const MapView& view) {
    MapCorrection correction;
    const Sim3 before = to_sim3(view.keyframe(DriftedLaps::id(0))->T_cw);
    correction.move(DriftedLaps::id(0), before, before * change.inverse());
    correction.place(view.point_ids().front(), {1, 2, 3});
    return correction.delta(view);
  });
  EXPECT_EQ(delta.poses.size(), 6u);
  laps.map->read([&](const MapView& view) {
    for (const KeyFramePose& pose : delta.poses) {
      const SE3 expected = to_se3(to_sim3(view.keyframe(pose.id)->T_cw) * change.inverse());
      EXPECT_LT(center_error(pose.T_cw, expected), 1e-9);
      EXPECT_LT((pose.T_cw.R - expected.R).norm(), 1e-9);
      EXPECT_EQ(pose.version, 1u);
    }
    EXPECT_EQ(delta.positions.size(), view.point_count());
    EXPECT_EQ(delta.positions.front().p_w, Eigen::Vector3d(1, 2, 3));
    for (std::size_t i = 1; i < delta.positions.size(); ++i)
      EXPECT_LT((delta.positions[i].p_w - change * view.point(delta.positions[i].id)->p_w).norm(),
                1e-9);
    return 0;
  });
}

TEST(GlobalBundleTest, WhatWasAddedMeanwhileMovesAlong) {
  DriftedLaps laps({.turn_rad = 0, .move_m = 0});
  for (int i = 0; i < 12; ++i) laps.add();
  // Bends the whole map a little, except its origin.
  const MapDelta bend = laps.map->read([](const MapView& view) {
    MapDelta delta;
    Vector7 twist = Vector7::Zero();
    twist(0) = 0.02;
    twist(4) = 0.01;
    const SE3 T = to_se3(sim3_exp(twist));
    for (const KeyFrameId id : view.keyframe_ids())
      if (id != view.origin()) delta.poses.push_back({id, T * view.keyframe(id)->T_cw, 1});
    return delta;
  });
  laps.map->commit(bend);
  auto bundle = GlobalBundle::of(*laps.map, {.robust_iterations = 10, .final_iterations = 0});
  ASSERT_TRUE(bundle);
  const double cost = bundle->cost();
  while (bundle->step()) {
  }
  EXPECT_LT(bundle->cost(), 0.5 * cost);
  // Meanwhile a keyframe arrives, at a pose relative to its bent parent.
  const KeyFrameId fresh = laps.add();
  const auto [parent, T_fp] = laps.map->read([&](const MapView& view) {
    const KeyFrame& keyframe = *view.keyframe(fresh);
    return std::pair(keyframe.parent,
                     keyframe.T_cw * view.keyframe(keyframe.parent)->T_cw.inverse());
  });
  const MapDelta result = bundle->result(*laps.map);
  EXPECT_EQ(laps.map->commit(result).stale, 0);
  for (int k = 0; k < 12; ++k) EXPECT_LT(laps.error_m(k), 0.01) << k;
  laps.map->read([&](const MapView& view) {
    EXPECT_LT(center_error(view.keyframe(fresh)->T_cw, T_fp * view.keyframe(parent)->T_cw), 1e-9);
    return 0;
  });
}

TEST(GlobalBundleTest, AMapOfOneKeyFrameHasNothingToMove) {
  DriftedLaps laps({});
  EXPECT_FALSE(GlobalBundle::of(*laps.map, {}));
  laps.add();
  EXPECT_FALSE(GlobalBundle::of(*laps.map, {}));
}

}  // namespace
}  // namespace slambed::testing
