// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <span>
#include <vector>

#include "map/map.hpp"

namespace slambed::edgeslam_semantic {

/// The part of the global map that the mobile keeps: the newest uploaded keyframes and all points
/// they see. It has no features because both nodes have them already.
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

/// Reads the window of these keyframes from a map. Positions are rounded as a slice carries them.
MapWindow window_of(const MapView& view, std::span<const KeyFrameId> keyframes);

/// The difference between a window and a later one.
struct MapSlice {
  /// Positions of new and moved points, poses of new and moved keyframes, and observations. Culled
  /// ones are gone from the global map; a point that was merged into another is in fusions.
  MapDelta changes;
  std::vector<KeyFrameId> left_keyframes;  ///< still in the global map
  std::vector<MapPointId> left_points;
};

/// Returns the slice that turns `before` into `now`. view: the map from which `now` was read.
MapSlice difference(const MapWindow& before, const MapWindow& now, const MapView& view);
/// Applies a slice: turns difference()'s `before` into its `now`.
void apply(MapWindow& window, const MapSlice& slice);

}  // namespace slambed::edgeslam_semantic
