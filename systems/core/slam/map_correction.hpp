// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>

#include "geometry/sim3.hpp"
#include "map/map.hpp"

namespace slambed {

/// New poses for part of a map, carried over to all of it: keyframes that are not mentioned follow
/// their parents in the spanning tree, points follow a keyframe. What was added to the map while
/// the poses were computed thus moves along.
class MapCorrection {
 public:
  /// before: where the points that go with the keyframe believe it to be (its pose in the map, with
  /// the scale of its surroundings).
  void move(KeyFrameId id, const Sim3& before, const Sim3& after);
  /// The point goes with this keyframe instead of its reference.
  void anchor(MapPointId point, KeyFrameId keyframe) { anchors_[point] = keyframe; }
  /// The point's position is known.
  void place(MapPointId point, const Eigen::Vector3d& p_w) { placed_[point] = p_w; }

  /// Every keyframe and point that moves, one version on.
  MapDelta delta(const MapView& view) const;

 private:
  struct Move {
    Sim3 before, after;
  };
  /// Carries points of the old map to the corrected one as seen from a keyframe; nothing when
  /// neither it nor any of its ancestors moves.
  std::optional<Sim3> change_at(const MapView& view, KeyFrameId id) const;

  std::map<KeyFrameId, Move> moves_;
  std::map<MapPointId, KeyFrameId> anchors_;
  std::map<MapPointId, Eigen::Vector3d> placed_;
};

}  // namespace slambed
