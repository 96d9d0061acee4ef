// SPDX-License-Identifier: Apache-2.0
// Keyframes that the mobile made on the map from before a loop was closed.
#include "offload/edge/loop_correction_log.hpp"

#include <gtest/gtest.h>

#include "map/tests/map_fixture.hpp"

namespace slambed {
namespace {

using testing::kf;

class LoopCorrectionLogTest : public ::testing::Test {
 protected:
  LoopCorrectionLogTest() {
    MapDelta delta;
    for (std::uint64_t n = 1; n <= 60; ++n) delta.points.push_back(testing::new_point(n));
    delta.keyframes = {testing::new_keyframe(1, testing::points_from(1, 30)),
                       testing::new_keyframe(2, testing::points_from(21, 30))};
    map.commit(delta);
    T_cw_before = delta.keyframes[1].T_cw;
    shift.t = {1, 2, 0};
    shift.R = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  }
  /// Moves the second keyframe by `shift` (from its first pose); the first one stays.
  void close_loop() {
    MapDelta moved;
    moved.poses = {{kf(2), T_cw_before * shift.inverse(), ++version}};
    log.commit(map, moved);
  }
  /// Sends this many updates.
  void updates(int count) {
    while (count-- > 0) log.update([](std::uint64_t) {});
  }
  /// Makes a keyframe at x that sees these points, and one new point 4 m in front of it.
  MapDelta made(double x, std::uint64_t first_point) {
    MapDelta delta;
    NewPoint fresh = testing::new_point(100, {x, 0, 4});
    fresh.appearance.normal = {1, 0, 0};
    delta.points = {fresh};
    auto seen = testing::points_from(first_point, 20);
    seen.push_back(100);
    delta.keyframes = {testing::new_keyframe(3, seen)};
    delta.keyframes[0].T_cw.t = {-x, 0, 0};
    return delta;
  }
  MapDelta correct(const MapDelta& delta, std::uint64_t applied) {
    return log.correct(map, delta, applied);
  }
  Map map;
  LoopCorrectionLog log;
  SE3 shift, T_cw_before;
  std::uint32_t version = 0;
};

TEST_F(LoopCorrectionLogTest, WhatIsMadeOnTheOldMapMovesAsItsNeighborDid) {
  updates(5);
  close_loop();
  const MapDelta moved = correct(made(0.5, 31), 5);
  const SE3 T_wc = moved.keyframes[0].T_cw.inverse();
  EXPECT_LT((T_wc.t - shift * Eigen::Vector3d(0.5, 0, 0)).norm(), 1e-12);
  EXPECT_LT((T_wc.R - shift.R).norm(), 1e-12);
  EXPECT_LT((moved.points[0].p_w - shift * Eigen::Vector3d(0.5, 0, 4)).norm(), 1e-12);
  EXPECT_LT((moved.points[0].appearance.normal - shift.R.col(0).cast<float>()).norm(), 1e-6);
}

TEST_F(LoopCorrectionLogTest, BothKeyframesOfADeltaMove) {
  updates(5);
  close_loop();
  MapDelta two = made(0.5, 31);
  two.keyframes.push_back(testing::new_keyframe(4, testing::points_from(31, 20)));
  two.keyframes[1].T_cw.t = {-0.7, 0, 0};
  const MapDelta moved = correct(two, 5);
  for (const auto& [index, x] : {std::pair{0, 0.5}, std::pair{1, 0.7}}) {
    const Eigen::Vector3d center = moved.keyframes[index].T_cw.inverse().t;
    EXPECT_LT((center - shift * Eigen::Vector3d(x, 0, 0)).norm(), 1e-12) << index;
  }
}

TEST_F(LoopCorrectionLogTest, ANeighborThatStayedMovesNothing) {
  updates(5);
  close_loop();
  const MapDelta delta = made(0.5, 1);
  EXPECT_LT((correct(delta, 5).keyframes[0].T_cw.t - delta.keyframes[0].T_cw.t).norm(), 1e-12);
}

TEST_F(LoopCorrectionLogTest, WhoHasTakenALaterUpdateOverIsOnTheNewMap) {
  updates(5);
  close_loop();
  const MapDelta delta = made(0.5, 31);
  EXPECT_EQ(correct(delta, 6).points[0].p_w, delta.points[0].p_w);
  // The old correction stays dropped: messages arrive in order.
  EXPECT_EQ(correct(delta, 6).keyframes[0].T_cw.t, delta.keyframes[0].T_cw.t);
}

TEST_F(LoopCorrectionLogTest, WithoutACorrectionOrANeighborNothingMoves) {
  const MapDelta delta = made(0.5, 31);
  log.commit(map, {});
  EXPECT_EQ(correct(delta, 0).points[0].p_w, delta.points[0].p_w);
  updates(5);
  close_loop();
  const MapDelta alone = made(0.5, 200);  // points that the map does not have
  EXPECT_EQ(correct(alone, 0).points[0].p_w, alone.points[0].p_w);
  log.forget();
  EXPECT_EQ(correct(delta, 0).points[0].p_w, delta.points[0].p_w);
}

TEST_F(LoopCorrectionLogTest, AnUpdateReadBetweenTheTwoHalvesOfAClosingKnowsOfTheFirstOnly) {
  const SE3 whole = shift * shift;
  close_loop();
  log.update([&](std::uint64_t number) { EXPECT_EQ(number, 1u); });
  shift = whole;
  close_loop();
  const Eigen::Vector3d p(0.5, 0, 4);
  EXPECT_LT((correct(made(0.5, 31), 0).points[0].p_w - whole * p).norm(), 1e-9);
  SE3 half;
  half.t = {1, 2, 0};
  half.R = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_LT((correct(made(0.5, 31), 1).points[0].p_w - half * p).norm(), 1e-9);
}

TEST_F(LoopCorrectionLogTest, AKeyframeThatMovedAlongMovesTheNext) {
  updates(5);
  close_loop();
  const MapDelta first = correct(made(0.5, 31), 5);
  map.commit(first);
  MapDelta second = made(0.7, 200);
  second.keyframes[0].id = kf(4);
  for (std::size_t i = 0; i < 5; ++i) second.keyframes[0].points[i] = testing::pt(100);
  const MapDelta moved = correct(second, 5);
  const Eigen::Vector3d center = moved.keyframes[0].T_cw.inverse().t;
  EXPECT_LT((center - shift * Eigen::Vector3d(0.7, 0, 0)).norm(), 1e-9);
}

TEST_F(LoopCorrectionLogTest, AfterTwoCorrectionsTheOldestMapCounts) {
  updates(5);
  close_loop();
  shift = shift * shift;
  updates(2);
  close_loop();
  // Made before both corrections: moved by all of it. Made between them: moved by the second only,
  // which doubled the first.
  const Eigen::Vector3d p(0.5, 0, 4);
  EXPECT_LT((correct(made(0.5, 31), 5).points[0].p_w - shift * p).norm(), 1e-9);
  SE3 half;
  half.t = {1, 2, 0};
  half.R = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_LT((correct(made(0.5, 31), 6).points[0].p_w - half * p).norm(), 1e-9);
}

}  // namespace
}  // namespace slambed
