// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "map/map.hpp"
#include "slam/tracker.hpp"

namespace slambed {

struct StampedPose {
  double timestamp_s = 0;
  SE3 T_cw;
};

/// Records every tracked frame relative to its reference keyframe, so that the trajectory follows
/// later corrections of the map. Not thread-safe.
class TrajectoryRecorder {
 public:
  /// Frames without a pose are left out; a reset forgets everything before it.
  void add(double timestamp_s, const TrackOutcome& outcome);
  /// Stores the current poses of the reference keyframes. Call it before a map is replaced or
  /// cleared: frames whose keyframe is not in the later map keep the last stored pose.
  void note(const Map& map);

  /// Returns poses after all corrections: T_cw = T_cr * T_rw with the reference's pose in the map,
  /// else its last stored pose; failing both, the pose at tracking time.
  std::vector<StampedPose> final_poses(const Map& map) const;
  /// Returns the poses at tracking time.
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
