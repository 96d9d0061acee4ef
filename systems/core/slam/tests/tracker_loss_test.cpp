// SPDX-License-Identifier: Apache-2.0
// Tracking loss and recovery.
#include "slam/tracker.hpp"

#include <gtest/gtest.h>

#include "slam/tests/tracker_rig.hpp"

namespace slambed::testing {
namespace {

TEST(Tracker, LostEarlyStartsOver) {
  SyntheticScene scene;
  TrackerRig rig;
  rig.show(scene.look(walk(0)));
  rig.show(scene.look(walk(1)));
  const TrackOutcome outcome = rig.show(scene.nothing());
  EXPECT_EQ(outcome.state, TrackingState::kNotInitialized);
  EXPECT_TRUE(outcome.reset_now);
  EXPECT_EQ(rig.keyframes(), 0u);
  const TrackOutcome again = rig.show(scene.look(walk(3)));
  EXPECT_TRUE(again.initialized_now);
  EXPECT_EQ(again.reference.value & 0xff, 2u) << "ids are never reused";
}

TEST(Tracker, SurvivesBlackFramesAndFindsItsPlaceAgain) {
  SyntheticScene scene;
  TrackerRig rig({.reset_below_keyframes = 1});
  for (int i = 0; i < 60; ++i) rig.show(scene.look(walk(i)));
  for (int i = 0; i < 5; ++i) {
    const TrackOutcome black = rig.show(scene.nothing());
    EXPECT_EQ(black.state, TrackingState::kLost);
    EXPECT_EQ(rig.tracker.keyframe_need(), KeyFrameNeed::kNone);
    EXPECT_TRUE(rig.tracker.create_keyframe().empty());
  }
  for (int i = 70; i < 80; ++i) {
    const TrackOutcome back = rig.show(scene.look(walk(i)));
    ASSERT_EQ(back.state, TrackingState::kOk) << "frame " << i;
    EXPECT_LT(center_error(back.T_cw, truth(i)), 2e-3);
    EXPECT_EQ(back.by_motion_model, i >= 72);
  }
}

/// Counts lost frames of six after a recovery in a place that only provisional keyframes see.
int lost_after_recovery(TrackerOptions options) {
  SyntheticScene scene;
  options.reset_below_keyframes = 1;
  TrackerRig rig(options);
  const auto turned = [&](int degrees) {
    const Eigen::AngleAxisd turn(degrees * M_PI / 180, Eigen::Vector3d::UnitY());
    return scene.look(SE3(turn.toRotationMatrix(), Eigen::Vector3d::Zero()) * walk(0));
  };
  for (int degrees = 0; degrees <= 180; degrees += 2) {
    EXPECT_EQ(rig.show(turned(degrees), degrees < 30).state, TrackingState::kOk) << degrees;
    if (degrees >= 30 && degrees % 10 == 0) {
      EXPECT_FALSE(rig.tracker.create_keyframe(false).keyframes.empty());
    }
  }
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(rig.show(scene.nothing(), false).state, TrackingState::kLost);
  int lost = 0;
  for (int degrees = 180; degrees <= 190; degrees += 2)
    lost += rig.show(turned(degrees), false).state == TrackingState::kLost;
  return lost;
}

TEST(Tracker, StaysFoundWhereOnlyProvisionalKeyFramesSeeThePlace) {
  EXPECT_EQ(lost_after_recovery({}), 0);
  EXPECT_EQ(lost_after_recovery({.second_hypotheses = false, .follow_recovery = true}), 0);
  EXPECT_EQ(lost_after_recovery({.second_hypotheses = false}), 3) << "ORB-SLAM2's steps alone";
}

TEST(Tracker, RelocalizesAfterAJumpToAKnownPlace) {
  SyntheticScene scene;
  TrackerRig rig({.reset_below_keyframes = 1});
  for (int i = 0; i < 120; ++i) rig.show(scene.look(walk(i)));
  // Looks at the unseen wall behind, then at a place from long ago.
  const SE3 behind(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                   Eigen::Vector3d::Zero());
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(rig.show(scene.look(behind * walk(110))).state, TrackingState::kLost);
  bool found = false;
  for (int i = 20; i < 30 && !found; ++i) {
    const TrackOutcome back = rig.show(scene.look(walk(i)));
    found = back.state == TrackingState::kOk;
    if (found) {
      EXPECT_LT(center_error(back.T_cw, truth(i)), 2e-3);
    }
  }
  EXPECT_TRUE(found);
}

TEST(Tracker, ResumesAtAPoseThatSomebodyElseFound) {
  SyntheticScene scene;
  TrackerRig rig({.reset_below_keyframes = 0});
  KeyFrameId old;
  for (int i = 0; i < 120; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    if (i == 20) old = outcome.reference;
  }
  const SE3 pose = truth(20);
  EXPECT_FALSE(rig.tracker.continue_from(pose, old)) << "not lost";
  EXPECT_EQ(rig.show(scene.nothing()).state, TrackingState::kLost);
  EXPECT_FALSE(rig.tracker.continue_from(pose, KeyFrameId{12345})) << "nobody knows that keyframe";
  EXPECT_EQ(rig.tracker.state(), TrackingState::kLost);
  ASSERT_TRUE(rig.tracker.continue_from(pose, old));
  EXPECT_EQ(rig.tracker.state(), TrackingState::kOk);
  EXPECT_FALSE(rig.tracker.wants_keyframe({}));
  for (int i = 23; i < 30; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_LT(center_error(outcome.T_cw, truth(i)), 2e-3);
  }
}

TEST(Tracker, AWrongPoseIsNotBelievedForLong) {
  SyntheticScene scene, other(5000, 2);
  TrackerRig rig({.reset_below_keyframes = 0});
  for (int i = 0; i < 30; ++i) rig.show(scene.look(walk(i)));
  const TrackOutcome last = rig.show(scene.look(walk(30)), false);
  EXPECT_EQ(rig.show(other.look(walk(31))).state, TrackingState::kLost);
  ASSERT_TRUE(rig.tracker.continue_from(last.T_cw, last.reference));
  EXPECT_EQ(rig.show(other.look(walk(32))).state, TrackingState::kLost);
}

/// Makes a FoundFrame of a keyframe.
FoundFrame found_at(const Map& map, KeyFrameId id) {
  return map.read([&](const MapView& view) {
    const KeyFrame& keyframe = *view.keyframe(id);
    return FoundFrame{.index = keyframe.frame_index,
                      .timestamp_s = keyframe.timestamp_s,
                      .features = keyframe.features,
                      .T_cw = keyframe.T_cw,
                      .reference = id,
                      .points = keyframe.points};
  });
}

TEST(Tracker, GoesOnFromAFrameThatSomebodyElseFoundAndIsLostUntilThen) {
  SyntheticScene scene;
  TrackerRig rig({.reset_below_keyframes = 0});
  KeyFrameId old;
  int seen_at = 0;
  for (int i = 0; i < 120; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    if (i == 20) old = outcome.reference;
  }
  const Map& map = *rig.tracker.map();
  FoundFrame found = found_at(map, old);
  seen_at = static_cast<int>(found.index);
  EXPECT_FALSE(rig.tracker.continue_from(found)) << "not lost";
  EXPECT_EQ(rig.show(scene.nothing()).state, TrackingState::kLost);
  FoundFrame unknown = found;
  unknown.reference = KeyFrameId{12345};
  EXPECT_FALSE(rig.tracker.continue_from(unknown)) << "nobody knows that keyframe";
  FoundFrame cut = found;
  cut.points.pop_back();
  EXPECT_FALSE(rig.tracker.continue_from(cut)) << "matches of another frame";
  ASSERT_TRUE(rig.tracker.continue_from(found));
  EXPECT_EQ(rig.tracker.state(), TrackingState::kLost);
  for (int i = seen_at + 2; i < seen_at + 8; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_EQ(outcome.resumed, i == seen_at + 2);
    EXPECT_LT(center_error(outcome.T_cw, truth(i)), 2e-3);
  }
}

TEST(Tracker, AFrameThatWasFoundAtAWrongPlaceEndsNoLoss) {
  SyntheticScene scene, other(5000, 2);
  TrackerRig rig({.reset_below_keyframes = 0});
  for (int i = 0; i < 30; ++i) rig.show(scene.look(walk(i)));
  const KeyFrameId last = rig.show(scene.look(walk(30)), false).reference;
  const FoundFrame found = found_at(*rig.tracker.map(), last);
  EXPECT_EQ(rig.show(other.look(walk(31))).state, TrackingState::kLost);
  ASSERT_TRUE(rig.tracker.continue_from(found));
  const TrackOutcome outcome = rig.show(other.look(walk(32)));
  EXPECT_EQ(outcome.state, TrackingState::kLost);
  EXPECT_FALSE(outcome.resumed);
  // The FoundFrame is tried once; the next frame relocalizes as usual.
  EXPECT_EQ(rig.show(scene.look(walk(33))).state, TrackingState::kOk);
}

}  // namespace
}  // namespace slambed::testing
