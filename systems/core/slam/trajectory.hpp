// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "map/map.hpp"
#include "slam/tracker.hpp"

namespace slambed {

/// A pose of the camera at a time.
struct StampedPose {
  double timestamp_s = 0;
  SE3 T_cw;
};

/// Remembers every tracked frame relative to its reference keyframe, so that the trajectory follows
/// what the map learns later. Not thread-safe.
class TrajectoryRecorder {
 public:
  /// Frames without a pose are left out; a reset forgets everything before it.
  void add(double timestamp_s, const TrackOutcome& outcome);
  /// Notes where the reference keyframes are now. Call it before a map is replaced or cleared:
  /// frames whose keyframe a later map does not know keep the latest pose that was noted.
  void note(const Map& map);

  /// After all corrections: T_cw = T_cr * T_rw with the reference's pose in the map, else the
  /// latest noted one, else the pose at the time.
  std::vector<StampedPose> final_poses(const Map& map) const;
  /// As they were when the frames were tracked.
  std::vector<StampedPose> live_poses() const;
  std::size_t size() const { return records_.size(); }

 private:
  struct Record {
    double timestamp_s;
    KeyFrameId reference;
    SE3 T_cr, T_cw;
  };
  std::vector<Record> records_;
  std::map<KeyFrameId, SE3> noted_;
};

}  // namespace slambed
