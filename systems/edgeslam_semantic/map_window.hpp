// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <span>
#include <vector>

#include "map/map.hpp"

namespace slambed::edgeslam_semantic {

/// The part of the global map that the mobile keeps: the newest uploaded keyframes and all points
/// they see. Features are not in it: both nodes have them.
struct MapWindow {
  struct ObservedKeyFrame {
    SE3 T_cw;
    std::map<std::uint16_t, MapPointId> points;  ///< by feature

    bool operator==(const ObservedKeyFrame& other) const {
      return T_cw.R == other.T_cw.R && T_cw.t == other.T_cw.t && points == other.points;
    }
  };
  std::map<KeyFrameId, ObservedKeyFrame> keyframes;
  std::map<MapPointId, Eigen::Vector3d> points;
};

/// As it is in a map. Positions are rounded to what a slice carries.
MapWindow window_of(const MapView& view, std::span<const KeyFrameId> keyframes);

/// What turns one window into a later one.
struct MapSlice {
  /// Points by position, new and moved alike; keyframes by pose; observations. Culled: gone from
  /// the global map; a point that became another there is in fusions.
  MapDelta changes;
  std::vector<KeyFrameId> left_keyframes;  ///< still in the global map
  std::vector<MapPointId> left_points;
};

/// view: the map that `now` was taken of.
MapSlice difference(const MapWindow& before, const MapWindow& now, const MapView& view);
/// difference's inverse: before becomes now.
void apply(MapWindow& window, const MapSlice& slice);

}  // namespace slambed::edgeslam_semantic
