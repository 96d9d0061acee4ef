// SPDX-License-Identifier: Apache-2.0
// Frame-to-frame tracking in a world with known ground truth.
#include "slam/tracker.hpp"

#include <gtest/gtest.h>

#include "slam/tests/tracker_rig.hpp"

namespace slambed::testing {
namespace {

TEST(Tracker, FirstFrameBecomesTheFirstKeyFrame) {
  SyntheticScene scene;
  TrackerRig rig;
  const auto features = scene.look(walk(0));
  const TrackOutcome outcome = rig.tracker.track(7, 0.5, features);
  EXPECT_EQ(outcome.state, TrackingState::kOk);
  EXPECT_TRUE(outcome.initialized_now);
  EXPECT_EQ(rig.tracker.keyframe_need(), KeyFrameNeed::kUrgent);
  EXPECT_TRUE(rig.tracker.wants_keyframe({false, 9, true}));
  const MapDelta delta = rig.tracker.create_keyframe();
  ASSERT_EQ(delta.keyframes.size(), 1u);
  EXPECT_EQ(delta.keyframes[0].id, outcome.reference);
  EXPECT_EQ(delta.keyframes[0].frame_index, 7u);
  EXPECT_EQ(delta.points.size(), static_cast<std::size_t>(features->size()));
  EXPECT_EQ(rig.map->commit(delta).applied, 0) << "it was committed already";
  EXPECT_EQ(rig.tracker.keyframe_need(), KeyFrameNeed::kNone);
  EXPECT_EQ(rig.keyframes(), 1u);
}

TEST(Tracker, NoiseFreePathIsExact) {
  SyntheticScene scene;
  TrackerRig rig;
  for (int i = 0; i < 150; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_EQ(outcome.by_motion_model, i >= 2) << "frame " << i;
    // Only float rounding of pixels and depths is left.
    EXPECT_LT(center_error(outcome.T_cw, truth(i)), 1e-3) << "frame " << i;
    EXPECT_LT(turn_error_deg(outcome.T_cw, truth(i)), 0.02) << "frame " << i;
    if (i > 0) {
      EXPECT_GT(outcome.inliers, 300) << "frame " << i;
    }
  }
  EXPECT_GT(rig.keyframes(), 1u);
}

TEST(Tracker, NoisyPathStaysWithinCentimetres) {
  SyntheticScene scene;
  TrackerRig rig;
  double worst_m = 0, worst_deg = 0;
  for (int i = 0; i < 150; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(
        walk(i),
        {.pixel_noise = 0.5, .depth_noise = 0.01, .flipped_bits = 15, .wrong_share = 0.1}));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    worst_m = std::max(worst_m, center_error(outcome.T_cw, truth(i)));
    worst_deg = std::max(worst_deg, turn_error_deg(outcome.T_cw, truth(i)));
  }
  EXPECT_LT(worst_m, 0.03);
  EXPECT_LT(worst_deg, 0.5);
}

TEST(Tracker, SameInputSamePosesToTheLastBit) {
  const auto run = [] {
    SyntheticScene scene;
    TrackerRig rig;
    std::vector<double> numbers;
    for (int i = 0; i < 40; ++i) {
      const TrackOutcome outcome = rig.show(scene.look(walk(i), {.pixel_noise = 0.5}));
      for (int k = 0; k < 3; ++k) numbers.push_back(outcome.T_cw.t[k]);
      numbers.push_back(outcome.inliers);
    }
    return numbers;
  };
  EXPECT_EQ(run(), run());
}

TEST(Tracker, NeedsDepthAndFeaturesToBegin) {
  SyntheticScene scene;
  TrackerRig rig;
  EXPECT_EQ(rig.show(scene.nothing()).state, TrackingState::kNotInitialized);
  EXPECT_EQ(rig.show(scene.look(walk(0), {}, 500)).state, TrackingState::kNotInitialized);
  EXPECT_EQ(rig.show(scene.look(walk(0), {.depth_limit_m = 0})).state,
            TrackingState::kNotInitialized);
  EXPECT_FALSE(rig.tracker.wants_keyframe({}));
  EXPECT_TRUE(rig.tracker.create_keyframe().empty());
  EXPECT_EQ(rig.show(scene.look(walk(0), {}, 501)).state, TrackingState::kOk);
}

TEST(Tracker, DuplicateFramesDoNotHurt) {
  SyntheticScene scene;
  TrackerRig rig;
  for (int i = 0; i < 60; ++i) {
    const auto features = scene.look(walk(i));
    for (int copy = 0; copy < 1 + i % 3; ++copy) {
      const TrackOutcome outcome = rig.show(features);
      ASSERT_EQ(outcome.state, TrackingState::kOk);
      EXPECT_LT(center_error(outcome.T_cw, truth(i)), 1e-3);
    }
  }
}

TEST(Tracker, FallsBackToTheReferenceKeyFrameWhenMotionModelFails) {
  SyntheticScene scene;
  TrackerRig rig;
  for (int i = 0; i < 20; ++i) rig.show(scene.look(walk(i)));
  // A kick of 17 degrees between two frames moves everything by 150 px or more.
  const SE3 kick(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0, 0, 0});
  const TrackOutcome outcome = rig.show(scene.look(kick * walk(20)), false);
  EXPECT_EQ(outcome.state, TrackingState::kOk);
  EXPECT_FALSE(outcome.by_motion_model);
  EXPECT_LT(center_error(outcome.T_cw, kick * truth(20)), 1e-3);
}

TEST(Tracker, WordsHaveTheLastWordWithoutTheSecondLook) {
  for (const bool again : {true, false}) {
    SyntheticScene scene;
    Tracker tracker(
        {.reset_below_keyframes = 0, .second_hypotheses = false, .descriptor_fallback = again},
        std::make_shared<Map>(), IdSpace::kTracker);
    for (int i = 0; i < 10; ++i) {
      tracker.track(i, i / 30.0, scene.look(walk(i)));
      if (i == 0) tracker.create_keyframe();
    }
    // A kick, and few features, most of which get different words.
    const SE3 kick(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0, 0, 0});
    const TrackOutcome outcome =
        tracker.track(10, 10 / 30.0, scene.look(kick * walk(10), {.flipped_bits = 40}, 60));
    ASSERT_TRUE(outcome.search.motion_matches && outcome.search.word_matches);
    EXPECT_LT(*outcome.search.motion_matches, 20);
    EXPECT_LT(*outcome.search.word_matches, 15);
    if (again) {
      EXPECT_GE(*outcome.search.reference_matches, 15);
    } else {
      EXPECT_EQ(outcome.search.reference_matches, outcome.search.word_matches);
      EXPECT_EQ(outcome.state, TrackingState::kLost);
    }
    EXPECT_FALSE(outcome.by_motion_model);
  }
}

TEST(Tracker, ZeroDepthMidwayIsTrackedMonocularly) {
  SyntheticScene scene;
  TrackerRig rig;
  for (int i = 0; i < 20; ++i) rig.show(scene.look(walk(i)));
  for (int i = 20; i < 30; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i), {.depth_limit_m = 0}));
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_LT(center_error(outcome.T_cw, truth(i)), 1e-3);
  }
}

}  // namespace
}  // namespace slambed::testing
