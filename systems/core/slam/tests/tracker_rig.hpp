// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include "slam/tests/synthetic_scene.hpp"
#include "slam/tracker.hpp"

namespace slambed::testing {

/// A tracker that makes keyframes whenever it may, without a mapper.
class TrackerRig {
 public:
  explicit TrackerRig(TrackerOptions options = {})
      : map(std::make_shared<Map>()), tracker(options, map, IdSpace::kTracker) {}

  TrackOutcome show(std::shared_ptr<const FeatureSet> features, bool keyframes = true) {
    const TrackOutcome outcome = tracker.track(frame, frame / 30.0, std::move(features));
    ++frame;
    if (keyframes && tracker.wants_keyframe({})) {
      const MapDelta delta = tracker.create_keyframe();
      EXPECT_EQ(delta.keyframes.size(), 1u);
    }
    return outcome;
  }
  std::size_t keyframes() const {
    return map->read([](const MapView& view) { return view.keyframe_count(); });
  }

  std::shared_ptr<Map> map;
  Tracker tracker;
  std::uint64_t frame = 0;
};

/// The true pose in the map's world, which begins at the first camera.
inline SE3 truth(int frame) { return walk(frame) * walk(0).inverse(); }

}  // namespace slambed::testing
