// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// A snapshot of a map.
struct MapCopy {
  MapDelta whole;
  MapDelta gone;  ///< elements of an earlier copy that were fused or removed since
};
/// Copies the map. The map is locked only while copying; comparing works on copies.
MapCopy copy_of(const Map& map, const MapDelta& earlier);

/// Returns the changes from one copy to another that was made with it as argument. Contains new
/// elements, new poses and positions, changed observations, fusions and removals. Observation
/// counts are left out because they matter only for points of the last few keyframes.
MapDelta changes_since(const MapDelta& earlier, const MapCopy& later);

/// Adapts changes so that they can be committed to a map that has changed on its own since. They
/// win over what the map knows of the same elements (versions are raised above its own). Fused
/// points are replaced by their survivor; what the map has removed stays removed. Keyframes that
/// the map already has only move and gain observations. New points that no keyframe sees are
/// dropped.
MapDelta rebase_changes(const MapView& map, const MapDelta& changes);

}  // namespace slambed
