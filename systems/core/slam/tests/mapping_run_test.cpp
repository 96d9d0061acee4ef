// SPDX-License-Identifier: Apache-2.0
// Tracker and mapper in turn on a long noisy walk.
#include <gtest/gtest.h>

#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"
#include "slam/trajectory.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

struct Walked {
  std::vector<StampedPose> poses, live;
  std::size_t keyframes = 0, points = 0;
  int tracked = 0;
};

Walked walk_and_map(int frames) {
  SyntheticScene scene;
  auto map = std::make_shared<Map>();
  Tracker tracker({}, map, IdSpace::kTracker);
  LocalMapper mapper({}, map, IdSpace::kEdgeMapper);
  TrajectoryRecorder recorder;
  Walked run;
  for (int i = 0; i < frames; ++i) {
    const TrackOutcome outcome = tracker.track(i, i / 30.0,
                                               scene.look(walk(i), {.pixel_noise = 0.7,
                                                                    .depth_noise = 0.02,
                                                                    .flipped_bits = 15,
                                                                    .depth_limit_m = 4,
                                                                    .wrong_share = 0.1}));
    recorder.add(i / 30.0, outcome);
    run.tracked += outcome.state == TrackingState::kOk;
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
  run.poses = recorder.final_poses(*map);
  run.live = recorder.live_poses();
  map->read([&](const MapView& view) {
    run.keyframes = view.keyframe_count();
    run.points = view.point_count();
    return 0;
  });
  return run;
}

TEST(MappingRun, NoisyWalkIsTrackedToACentimetre) {
  constexpr int kFrames = 240;
  const Walked run = walk_and_map(kFrames);
  EXPECT_EQ(run.tracked, kFrames);
  EXPECT_GE(run.keyframes, 3u);
  EXPECT_LE(run.keyframes, 60u);
  EXPECT_GT(run.points, 800u);
  double sum = 0;
  for (int i = 0; i < kFrames; ++i) {
    const double error = center_error(run.poses[i].T_cw, walk(i) * walk(0).inverse());
    EXPECT_LT(error, 0.04) << "frame " << i;
    sum += error * error;
  }
  EXPECT_LT(std::sqrt(sum / kFrames), 0.012);
}

TEST(MappingRun, IsRepeatableToTheLastBit) {
  const Walked a = walk_and_map(60), b = walk_and_map(60);
  ASSERT_EQ(a.poses.size(), b.poses.size());
  EXPECT_EQ(a.points, b.points);
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_EQ(a.poses[i].T_cw.t, b.poses[i].T_cw.t);
    EXPECT_EQ(a.poses[i].T_cw.R, b.poses[i].T_cw.R);
  }
}

}  // namespace
}  // namespace slambed::testing
