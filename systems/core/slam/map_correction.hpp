// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>

#include "geometry/sim3.hpp"
#include "map/map.hpp"

namespace slambed {

/// Extends new poses for part of a map to the whole map: other keyframes follow their parents in
/// the spanning tree, and points follow a keyframe. Elements that were added while the poses were
/// computed thus move along.
class MapCorrection {
 public:
  /// before: the pose, with scale, that the keyframe's points currently refer to.
  void move(KeyFrameId id, const Sim3& before, const Sim3& after);
  /// The point follows this keyframe instead of its reference.
  void anchor(MapPointId point, KeyFrameId keyframe) { anchors_[point] = keyframe; }
  /// Sets the point's new position directly.
  void place(MapPointId point, const Eigen::Vector3d& p_w) { placed_[point] = p_w; }

  /// Returns every keyframe and point that moves, with versions increased by one.
  MapDelta delta(const MapView& view) const;

 private:
  struct Move {
    Sim3 before, after;
  };
  /// Returns the transform from the old to the corrected map at a keyframe; nothing if neither it
  /// nor any of its ancestors moves.
  std::optional<Sim3> change_at(const MapView& view, KeyFrameId id) const;

  std::map<KeyFrameId, Move> moves_;
  std::map<MapPointId, KeyFrameId> anchors_;
  std::map<MapPointId, Eigen::Vector3d> placed_;
};

}  // namespace slambed
