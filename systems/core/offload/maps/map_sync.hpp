// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// A map as it was at one time.
struct MapCopy {
  MapDelta whole;
  MapDelta gone;  ///< what of an earlier copy was not there any more: fusions and removals
};
/// Holds the map, and no longer than copying takes: what is compared are copies.
MapCopy copy_of(const Map& map, const MapDelta& earlier);

/// What has happened to a map between two copies, of which the later one knows the earlier: new
/// elements whole, moved ones by position, changed observations, fusions and removals. Observation
/// counts are left out: they decide about points of the last few keyframes only.
MapDelta changes_since(const MapDelta& earlier, const MapCopy& later);

/// The changes as they can be committed to a map that went on by itself since base. They win over
/// what that map knows of the same elements (versions are lifted above its own); points that it has
/// fused are named by their survivor, what it has removed stays removed, keyframes that it has
/// already only move and gain observations. Points that nothing sees then are left out.
MapDelta rebase_changes(const MapView& map, const MapDelta& changes);

}  // namespace slambed
