// SPDX-License-Identifier: Apache-2.0
// Pose corrections in a map of 40 keyframes and for a tracker that continues.
#include "slam/pose_correction.hpp"

#include <gtest/gtest.h>

#include <map>

#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

constexpr int kKeyFrames = 40;
constexpr int kFramesBetween = 3;  ///< 10 keyframes a second
constexpr double kFps = 30;
const CorrectionWindow kWindow{.window_s = 2, .graded = true};

KeyFrameId kf(int k) { return {std::uint64_t{1} << 56 | static_cast<unsigned>(k + 1)}; }

/// An error of 0.5 m and 4 degrees at this pose.
SE3 off(const SE3& T_cw) {
  Eigen::Matrix<double, 6, 1> twist;
  twist << 0.3, -0.1, 0.38, 0.02, 0.06, -0.03;
  return (SE3::exp(twist) * T_cw).normalized();
}

/// A tracker and a mapper without any other worker.
class Car {
 public:
  enum class Mapping { kNone, kBare, kAll };
  void drive(int frames, Mapping mapping) {
    for (const int end = frame_ + frames; frame_ < end; ++frame_) {
      outcome = tracker.track(
          frame_, frame_ / kFps,
          scene.look(walk(frame_), {.pixel_noise = 0.3, .depth_noise = 0.005, .flipped_bits = 5}));
      ASSERT_EQ(outcome.state, TrackingState::kOk) << frame_;
      if (mapping == Mapping::kNone || frame_ % kFramesBetween != 0) continue;
      mapper.insert(tracker.create_keyframe().keyframes[0].id);
      if (mapping != Mapping::kAll) continue;
      map->commit(mapper.cull_points());
      map->commit(mapper.triangulate());
      map->commit(mapper.fuse());
      if (mapper.begin_bundle()) {
        while (mapper.step_bundle()) {
        }
        map->commit(mapper.finish_bundle());
      }
    }
  }
  SE3 pose(int k) const {
    return map->read([&](const MapView& view) { return view.keyframe(kf(k))->T_cw; });
  }
  PoseCorrection correct(int k, const SE3& T_cw, const CorrectionWindow& window = kWindow) {
    const auto before = map->read([&](const MapView& view) {
      return std::make_pair(correct_pose(view, kf(k), T_cw, window),
                            *view.pose_of(tracker.reference()));
    });
    const PoseCorrection& correction = before.first.value();
    map->commit(correction.delta);
    tracker.moved(correction.T_new_old, before.second);
    mapper.limit_bundles({.since_s = correction.since_s, .held = kf(k)});
    return correction;
  }

  SyntheticScene scene;
  std::shared_ptr<Map> map = std::make_shared<Map>();
  Tracker tracker{{}, map, IdSpace::kTracker};
  LocalMapper mapper{{}, map, IdSpace::kMobileMapper};
  TrackOutcome outcome;

 private:
  int frame_ = 0;
};

class PoseCorrectionTest : public ::testing::Test {
 protected:
  PoseCorrectionTest() { car.drive(kFramesBetween * kKeyFrames, Car::Mapping::kBare); }
  Car car;
};

TEST_F(PoseCorrectionTest, PutsTheKeyframeWhereItWasToldAndFadesBackInTime) {
  constexpr int k = 32;
  const SE3 answer = off(car.pose(k));
  std::map<int, SE3> before;
  for (int i = 0; i < kKeyFrames; ++i) before[i] = car.pose(i);
  const double distance_m = center_error(before[k], answer);
  const PoseCorrection correction = car.correct(k, answer);
  EXPECT_NEAR(correction.magnitude_m, distance_m, 1e-9);
  EXPECT_NEAR(correction.rotation_deg, 4.0, 0.1);
  EXPECT_LT(center_error(car.pose(k), answer), 1e-3);
  EXPECT_LT(turn_error_deg(car.pose(k), answer), 1e-2);
  const int begin = k - static_cast<int>(kWindow.window_s * kFps / kFramesBetween);
  double last_m = 0;
  for (int i = 0; i < kKeyFrames; ++i) {
    const SE3 now = car.pose(i);
    const double moved_m = center_error(now, before[i]);
    if (i < begin) {
      EXPECT_TRUE(now.R == before[i].R && now.t == before[i].t) << "before the window: " << i;
    } else if (i < k) {
      EXPECT_LT(moved_m, distance_m + 0.01) << i;
      EXPECT_GE(moved_m, last_m) << i;
    } else {
      // Newer keyframes keep their pose relative to k.
      EXPECT_LT(center_error(now * car.pose(k).inverse(), before[i] * before[k].inverse()), 1e-6);
    }
    last_m = i >= begin && i < k ? moved_m : last_m;
  }
  EXPECT_GT(last_m, 0.8 * distance_m);
}

TEST_F(PoseCorrectionTest, RigidMovesTheWindowAlike) {
  constexpr int k = 32;
  const SE3 answer = off(car.pose(k)), first = car.pose(0), inside = car.pose(20),
            at_k = car.pose(k);
  car.correct(k, answer, {.window_s = 2, .graded = false});
  EXPECT_TRUE(car.pose(0).t == first.t && car.pose(0).R == first.R);
  EXPECT_LT(center_error(car.pose(20) * car.pose(k).inverse(), inside * at_k.inverse()), 1e-6);
  car.correct(k, at_k, {.window_s = std::numeric_limits<double>::infinity()});
  EXPECT_GT(center_error(car.pose(0), first), 0.2) << "an infinite window is the whole map";
}

TEST_F(PoseCorrectionTest, OneErrorToldTwiceInFlightIsAppliedOnce) {
  const SE3 move = off(SE3());
  // Both answers were computed before the first correction.
  const SE3 told_1 = car.pose(30) * move, told_2 = car.pose(35) * move;
  EXPECT_GT(car.correct(30, told_1).magnitude_m, 0.3);
  const PoseCorrection second = car.correct(35, told_2);
  EXPECT_LT(second.magnitude_m, 1e-6);
  EXPECT_LT(second.rotation_deg, 1e-5);
  EXPECT_LT(center_error(car.pose(35), told_2), 1e-6);
}

TEST_F(PoseCorrectionTest, TheNextFrameKeepsItsInliersAndTheBundlesKeepTheCorrection) {
  car.drive(1, Car::Mapping::kNone);
  const int inliers = car.outcome.inliers;
  constexpr int k = 37;
  const SE3 answer = off(car.pose(k));
  const PoseCorrection correction = car.correct(k, answer);
  car.drive(1, Car::Mapping::kNone);
  EXPECT_GE(car.outcome.inliers, 0.8 * inliers);
  EXPECT_TRUE(car.outcome.by_motion_model);
  car.drive(10 * kFramesBetween, Car::Mapping::kAll);
  // The camera position shows how much of the correction remains.
  const int last = kFramesBetween * kKeyFrames + 1 + 10 * kFramesBetween;
  const SE3 uncorrected = walk(last) * walk(0).inverse();
  const SE3 expected = uncorrected * correction.T_new_old.inverse();
  const double full_m = center_error(uncorrected, expected);
  ASSERT_GT(full_m, 0.3);
  EXPECT_LT(center_error(car.outcome.T_cw, expected), 0.05 * full_m);
  EXPECT_LT(turn_error_deg(car.outcome.T_cw, expected), 0.05 * 4);
  EXPECT_LT(center_error(car.pose(k), answer), 1e-3) << "bundles hold the keyframe";
}

TEST_F(PoseCorrectionTest, ACarThatStoodLongerThanTheWindowIsCorrectedToo) {
  // Every point was first seen before the window and is still observed.
  constexpr int k = 39;
  const int inliers = car.outcome.inliers;
  const PoseCorrection correction =
      car.correct(k, off(car.pose(k)), {.window_s = 0.05, .graded = true});
  car.drive(1, Car::Mapping::kNone);
  EXPECT_GE(car.outcome.inliers, 0.8 * inliers);
  const SE3 expected =
      walk(kFramesBetween * kKeyFrames) * walk(0).inverse() * correction.T_new_old.inverse();
  EXPECT_LT(center_error(car.outcome.T_cw, expected), 0.05 * correction.magnitude_m);
}

TEST(PoseCorrection, AnUnknownKeyframeCorrectsNothing) {
  EXPECT_FALSE(Map().read(
      [](const MapView& view) { return correct_pose(view, kf(1000), SE3(), {}).has_value(); }));
}

}  // namespace
}  // namespace slambed::testing
