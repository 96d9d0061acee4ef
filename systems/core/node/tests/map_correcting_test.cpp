// SPDX-License-Identifier: Apache-2.0
// A correction during a stage of mapping, in virtual time.
#include <gtest/gtest.h>

#include "node/local_mapping.hpp"
#include "node/tests/virtual_pair.hpp"
#include "slam/pose_correction.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

struct Mapped {
  MapDelta before, after;  ///< right after the correction, at the end
  std::size_t points = 0;  ///< before mapping began
};

/// Maps the newest of some keyframes at 20 ms per stage. At time `when` the whole map is turned and
/// moved.
Mapped map_with_correction_at(RunTime when) {
  TemporaryFolder folder;
  EventLog log(folder.path() / "events.jsonl", NodeRole::kMobile);
  log.set_clock([] { return RunTime::zero(); });
  log.start(Duration::zero(), [] {});
  SyntheticScene scene;
  const auto map = std::make_shared<Map>();
  Tracker tracker({}, map, IdSpace::kTracker);
  KeyFrameId newest;
  for (int frame = 0; frame < 60; ++frame) {
    tracker.track(
        frame, frame / 30.0,
        scene.look(walk(frame), {.pixel_noise = 0.7, .depth_noise = 0.02, .depth_limit_m = 4}));
    if (frame % 10 == 0) newest = tracker.create_keyframe().keyframes.at(0).id;
  }
  Mapped mapped;
  mapped.points = map->read([](const MapView& view) { return view.point_count(); });
  Simulator simulator;
  VirtualRuntime runtime(simulator, uniform_device(20'000), 1, log);
  LocalMapping mapping(runtime, log, {}, map, IdSpace::kMobileMapper, LocalMapping::Mode::kWorker);
  mapping.start();
  runtime.spawn("tracking", [&](Worker& worker) {
    mapping.submit(worker, newest);
    worker.sleep_until(when);
    mapping.correct(*map, [&](const MapView& view) {
      Eigen::Matrix<double, 6, 1> twist;
      twist << 0.5, 0.2, -0.4, 0.1, 0.1, 0;
      auto correction = correct_pose(view, newest, SE3::exp(twist) * *view.pose_of(newest),
                                     {.window_s = std::numeric_limits<double>::infinity()});
      return std::make_pair(std::move(correction->delta), BundleLimits{});
    });
    mapped.before = map->read(snapshot);
    mapping.drained().wait(worker);
    runtime.stop();
  });
  simulator.run();
  runtime.join();
  mapped.after = map->read(snapshot);
  return mapped;
}

double most_moved_m(const Mapped& mapped) {
  double most = 0;
  for (const NewKeyFrame& was : mapped.before.keyframes)
    for (const NewKeyFrame& is : mapped.after.keyframes)
      if (is.id == was.id) most = std::max(most, center_error(is.T_cw, was.T_cw));
  return most;
}

// Stages end at 20 (insert), 40 (cull_points), 60 (triangulate), 80 (fuse), 100 ms and later
// (bundle).
TEST(MapCorrecting, WhatAStageComputedOnTheOldMapIsNotPutIntoTheNewOne) {
  const Mapped triangulated = map_with_correction_at(50ms);
  for (const NewPoint& point : triangulated.after.points)
    EXPECT_EQ(point.id.value >> 56, 1u) << "made from where keyframes were before the correction";
  // The bundle ran after the correction, so it adjusts the corrected map.
  EXPECT_GT(most_moved_m(triangulated), 0);
  EXPECT_LT(most_moved_m(triangulated), 0.05);

  const Mapped bundled = map_with_correction_at(150ms);
  EXPECT_TRUE(std::any_of(bundled.after.points.begin(), bundled.after.points.end(),
                          [](const NewPoint& point) { return point.id.value >> 56 == 3; }))
      << "points made before the correction move along and stay";
  EXPECT_EQ(most_moved_m(bundled), 0) << "the bundle of the old map is worth nothing";
}

}  // namespace
}  // namespace slambed::testing
