// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "slam/loop_verifier.hpp"

namespace slambed {

/// Correction of a loop: moves the new keyframe and its covisibles to the old part of the map.
struct LoopCorrection {
  struct Moved {
    KeyFrameId id;
    Sim3 before, after;
    std::vector<Covisible> connected_before;  ///< keyframes that shared a point with it; ascending
  };
  KeyFrameId keyframe, matched;
  std::vector<Moved> moved;              ///< the new keyframe and its covisibles, ascending
  std::vector<MapPointId> moved_points;  ///< moved with these keyframes; ascending
  MapDelta delta;  ///< poses, positions, new observations of old points, fusions into them
};

/// The map must not change until the delta is committed. The delta is empty if one of the keyframes
/// is gone.
class LoopCorrector {
 public:
  LoopCorrection correct(const Map& map, const LoopMatch& match);

 private:
  struct Target {
    KeyFrameCopy keyframe;
    SE3 T_cw;  ///< corrected
  };

  void move_points(const MapView& view, const LoopMatch& match, LoopCorrection& loop);
  void join_matches(const LoopMatch& match, LoopCorrection& loop);
  void join_projected(Target& target, LoopCorrection& loop);
  void join(Target& target, int feature, MapPointId old_point, LoopCorrection& loop);
  MapPointId alive(MapPointId id) const;

  std::vector<Target> targets_;
  std::vector<PointSketch> loop_points_;
  std::map<MapPointId, MapPointId> survivors_;  ///< of points fused in this correction
  Matcher matcher_;
};

}  // namespace slambed
