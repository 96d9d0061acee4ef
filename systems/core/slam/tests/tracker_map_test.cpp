// SPDX-License-Identifier: Apache-2.0
// What a tracker adds to its map, and how it follows changes by others.
#include "slam/tracker.hpp"

#include <gtest/gtest.h>

#include "slam/tests/tracker_rig.hpp"
#include "slam/trajectory.hpp"

namespace slambed::testing {
namespace {

TEST(Tracker, KeyFrameTakesCloseFeaturesAndObservationCounts) {
  SyntheticScene scene;
  TrackerRig rig;
  rig.show(scene.look(walk(0)));
  for (int i = 1; i < 12; ++i) rig.show(scene.look(walk(i)), false);
  const MapDelta delta = rig.tracker.create_keyframe();
  ASSERT_EQ(delta.keyframes.size(), 1u);
  const NewKeyFrame& keyframe = delta.keyframes[0];
  const Sensor& sensor = *scene.sensor();
  for (int i = 0; i < keyframe.features->size(); ++i)
    if (keyframe.features->keypoint(i).depth_m < sensor.close_depth_m) {
      EXPECT_TRUE(keyframe.points[i]);
    }
  ASSERT_GT(delta.observation_counts.size(), 300u);
  int ten_times = 0;
  for (const PointObservationCounts& s : delta.observation_counts) {
    EXPECT_LE(s.found, s.visible);
    ten_times += s.found >= 10;
  }
  EXPECT_GT(ten_times, 200);
  EXPECT_EQ(rig.tracker.create_keyframe().observation_counts.size(), 0u) << "handed on only once";
}

TEST(Tracker, ProvisionalKeyFrameDoesNotBecomeTheReference) {
  SyntheticScene scene;
  TrackerRig rig;
  const KeyFrameId first = rig.show(scene.look(walk(0))).reference;
  for (int i = 1; i < 10; ++i) rig.show(scene.look(walk(i)), false);
  ASSERT_FALSE(rig.tracker.create_keyframe(false).keyframes.empty());
  for (int i = 10; i < 20; ++i) EXPECT_EQ(rig.show(scene.look(walk(i)), false).reference, first);
  ASSERT_FALSE(rig.tracker.create_keyframe(true).keyframes.empty());
  EXPECT_NE(rig.show(scene.look(walk(20)), false).reference, first);
}

TEST(Tracker, FollowsCorrectionsOfTheMap) {
  SyntheticScene scene;
  TrackerRig rig;
  TrajectoryRecorder recorder;
  for (int i = 0; i < 40; ++i) recorder.add(i / 30.0, rig.show(scene.look(walk(i))));
  // The whole world is rotated and shifted.
  const SE3 T_new_old(
      Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(), {3, -2, 5});
  const MapDelta correction = rig.map->read([&](const MapView& view) {
    MapDelta delta;
    for (const KeyFrameId id : view.keyframe_ids())
      delta.poses.push_back({id, view.keyframe(id)->T_cw * T_new_old.inverse(), 1});
    for (const MapPointId id : view.point_ids())
      delta.positions.push_back({id, T_new_old * view.point(id)->p_w, 1});
    return delta;
  });
  rig.map->commit(correction);
  for (int i = 40; i < 60; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    recorder.add(i / 30.0, outcome);
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_TRUE(outcome.by_motion_model);
    EXPECT_LT(center_error(outcome.T_cw, truth(i) * T_new_old.inverse()), 1e-3);
  }
  const auto poses = recorder.final_poses(*rig.map);
  ASSERT_EQ(poses.size(), 60u);
  for (int i = 0; i < 60; ++i)
    EXPECT_LT(center_error(poses[i].T_cw, truth(i) * T_new_old.inverse()), 1e-3);
  EXPECT_LT(center_error(recorder.live_poses()[10].T_cw, truth(10)), 1e-3);
}

TEST(Tracker, FollowsFusionsAndCulls) {
  SyntheticScene scene;
  TrackerRig rig;
  for (int i = 0; i < 30; ++i) rig.show(scene.look(walk(i)));
  const MapDelta edit = rig.map->read([](const MapView& view) {
    MapDelta delta;
    const auto ids = view.point_ids();
    for (std::size_t i = 0; i < ids.size(); i += 4) delta.culled_points.push_back(ids[i]);
    return delta;
  });
  rig.map->commit(edit);
  for (int i = 30; i < 40; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_LT(center_error(outcome.T_cw, truth(i)), 1e-3);
  }
}

TEST(Tracker, StartsInTheWorldOfAnotherMap) {
  SyntheticScene scene;
  TrackerRig rig;
  rig.tracker.start_at(walk(0));
  for (int i = 0; i < 20; ++i) {
    const TrackOutcome outcome = rig.show(scene.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_LT(center_error(outcome.T_cw, walk(i)), 1e-3) << "frame " << i;
  }
  rig.show(scene.nothing());  // resets, and starts at the same pose
  const TrackOutcome again = rig.show(scene.look(walk(0)));
  ASSERT_TRUE(again.initialized_now);
  EXPECT_LT(center_error(again.T_cw, walk(0)), 1e-9);
}

TEST(Tracker, TellsWhatItsRuleKnows) {
  SyntheticScene scene;
  TrackerRig rig;
  rig.show(scene.look(walk(0)));
  const TrackOutcome outcome = rig.show(scene.look(walk(1)), false);
  const KeyFrameEvidence& evidence = rig.tracker.evidence();
  EXPECT_TRUE(evidence.tracked);
  EXPECT_EQ(evidence.inliers, outcome.inliers);
  EXPECT_EQ(evidence.keyframes, 1);
  EXPECT_EQ(evidence.frames_since_keyframe, 1);
  EXPECT_GT(evidence.close_tracked, 0);
  EXPECT_GE(outcome.searched_points, outcome.local_points);
  rig.show(scene.nothing());
  EXPECT_FALSE(rig.tracker.evidence().tracked);
}

}  // namespace
}  // namespace slambed::testing
