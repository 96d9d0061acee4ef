// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// What has happened to a map since it was as in base (a whole map as one delta): new elements
/// whole, moved ones by position, changed observations, fusions and removals. now: snapshot(map).
/// Sightings are left out: they decide about points of the last few keyframes only.
MapDelta changes_since(const MapDelta& base, const MapDelta& now, const MapView& map);

/// The changes as they can be committed to a map that went on by itself since base. They win over
/// what that map knows of the same elements (versions are lifted above its own); points that it has
/// fused are named by their survivor, what it has removed stays removed, keyframes that it has
/// already only move and gain observations. Points that nothing sees then are left out.
MapDelta rebase_changes(const MapView& map, const MapDelta& changes);

}  // namespace slambed
