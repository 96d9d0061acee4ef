// SPDX-License-Identifier: Apache-2.0
// Large motion between two frames: poses without a prediction.
#include <gtest/gtest.h>

#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"
#include "slam/trajectory.hpp"
#include "slam/wide_search.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

SE3 turned(double yaw_rad, const Eigen::Vector3d& center) {
  return SE3(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitY()).toRotationMatrix(), center)
      .inverse();
}

/// The points of a one-view map, and frames to locate among them.
class WideSearchTest : public ::testing::Test {
 protected:
  void make_map(const SE3& T_cw) {
    const auto features = scene.look(T_cw, {.flipped_bits = 20});
    for (int i = 0; i < features->size(); ++i) {
      PointSketch point;
      point.id = MapPointId{static_cast<std::uint64_t>(i + 1)};
      point.p_w = scene.point(scene.seen()[i]);
      point.descriptor = features->descriptor(i);
      points.push_back(point);
    }
  }
  bool locate(std::shared_ptr<const FeatureSet> features) {
    frame.begin(1, 0, std::move(features));
    return wide.locate(points, search, frame);
  }

  SyntheticScene scene;
  std::vector<PointSketch> points;
  WideSearch wide;
  FrameSearch search;
  Frame frame;
};

TEST_F(WideSearchTest, FindsAViewThatSharesAFifthOfTheImage) {
  make_map(turned(0, {0, 0, -1}));
  const SE3 truth = turned(0.75, {0.3, 0.1, -0.8});
  const Seeing noisy{.pixel_noise = 0.5, .depth_noise = 0.01, .flipped_bits = 20};
  ASSERT_TRUE(locate(scene.look(truth, noisy)));
  EXPECT_LT(center_error(frame.T_cw, truth), 0.03);
  EXPECT_LT(turn_error_deg(frame.T_cw, truth), 0.5);
  EXPECT_LT(frame.matches(), 400) << "the views share too much to be a test";
}

TEST_F(WideSearchTest, NearlyHalfOfTheMatchesMayBeWrong) {
  make_map(turned(0, {0, 0, -1}));
  const SE3 truth = turned(0.3, {0.2, 0, -0.9});
  for (const double depth_limit_m : {1e9, 0.0}) {  // with depth, and monocular
    ASSERT_TRUE(locate(scene.look(truth, {.pixel_noise = 0.5,
                                          .depth_noise = 0.01,
                                          .flipped_bits = 20,
                                          .depth_limit_m = depth_limit_m,
                                          .wrong_share = 0.4})));
    EXPECT_LT(center_error(frame.T_cw, truth), 0.03);
  }
}

TEST_F(WideSearchTest, FindsNothingInAnotherScene) {
  make_map(turned(0, {0, 0, -1}));
  SyntheticScene other(5000, 2);
  EXPECT_FALSE(locate(other.look(turned(0, {0, 0, -1}))));
  EXPECT_FALSE(locate(scene.nothing()));
  EXPECT_EQ(frame.matches(), 0);
  points.clear();
  EXPECT_FALSE(locate(scene.look(turned(0, {0, 0, -1}))));
}

struct GapRun {
  int lost = 0, resets = 0, unpredicted = 0;
  double ate_m = 0;
};

/// Plays every `step`th frame of the walk and maps each keyframe before the next frame.
GapRun play(int step, bool second_hypotheses, unsigned seed) {
  SyntheticScene scene(5000, seed);
  auto map = std::make_shared<Map>();
  TrackerOptions options{.max_frames_between_keyframes = std::max(1, 30 / step)};
  options.second_hypotheses = second_hypotheses;
  Tracker tracker(options, map, IdSpace::kTracker);
  LocalMapper mapper({}, map, IdSpace::kMobileMapper);
  TrajectoryRecorder recorder;
  GapRun run;
  for (int i = 0; i < 600; i += step) {
    const TrackOutcome outcome = tracker.track(i, i / 30.0,
                                               scene.look(walk(i), {.pixel_noise = 0.7,
                                                                    .depth_noise = 0.02,
                                                                    .flipped_bits = 30,
                                                                    .depth_limit_m = 4,
                                                                    .wrong_share = 0.15}));
    recorder.add(i / 30.0, outcome);
    run.lost += outcome.state != TrackingState::kOk;
    run.resets += outcome.reset_now;
    run.unpredicted += i > step && !outcome.by_motion_model;
    if (!tracker.wants_keyframe({})) continue;
    mapper.insert(tracker.create_keyframe().keyframes[0].id);
    map->commit(mapper.cull_points());
    map->commit(mapper.triangulate());
    map->commit(mapper.fuse());
    if (mapper.begin_bundle()) {
      while (mapper.step_bundle()) {
      }
      map->commit(mapper.finish_bundle());
    }
    map->commit(mapper.cull_keyframes());
  }
  double sum = 0;
  const auto poses = recorder.final_poses(*map);
  for (const StampedPose& pose : poses) {
    const int frame = static_cast<int>(std::lround(30 * pose.timestamp_s));
    const double error_m = center_error(pose.T_cw, walk(frame) * walk(0).inverse());
    sum += error_m * error_m;
  }
  run.ate_m = std::sqrt(sum / static_cast<double>(poses.size()));
  return run;
}

TEST(WideGaps, NoFrameIsLostThatSharesAViewWithTheMap) {
  int lost_by_the_ladder = 0, unpredicted = 0;
  for (const int step : {15, 20}) {
    for (const unsigned seed : {1u, 2u, 3u}) {
      const GapRun run = play(step, true, seed);
      EXPECT_EQ(run.lost, 0) << "every " << step << "th frame, seed " << seed;
      EXPECT_LT(run.ate_m, 0.03) << "every " << step << "th frame, seed " << seed;
      unpredicted += run.unpredicted;
      const GapRun ladder = play(step, false, seed);
      lost_by_the_ladder += ladder.lost + ladder.resets;
    }
  }
  EXPECT_GT(unpredicted, 10) << "too easy a walk";
  EXPECT_GT(lost_by_the_ladder, 0) << "too easy a walk";
}

TEST(WideGaps, WhereNothingIsKnownTheCameraIsLost) {
  SyntheticScene scene, other(5000, 2);
  auto map = std::make_shared<Map>();
  Tracker tracker({.reset_below_keyframes = 0}, map, IdSpace::kTracker);
  for (int i = 0; i < 30; ++i) {
    ASSERT_EQ(tracker.track(i, i / 30.0, scene.look(walk(i))).state, TrackingState::kOk);
    if (tracker.wants_keyframe({})) tracker.create_keyframe();
  }
  for (int i = 30; i < 40; ++i)
    EXPECT_EQ(tracker.track(i, i / 30.0, other.look(walk(i))).state, TrackingState::kLost);
  for (int i = 40; i < 45; ++i)
    EXPECT_EQ(tracker.track(i, i / 30.0, scene.nothing()).state, TrackingState::kLost);
  const TrackOutcome back = tracker.track(45, 1.5, scene.look(walk(45)));
  ASSERT_EQ(back.state, TrackingState::kOk);
  EXPECT_LT(center_error(back.T_cw, walk(45) * walk(0).inverse()), 2e-3);
}

}  // namespace
}  // namespace slambed::testing
