// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "map/map.hpp"

namespace slambed {

/// Copies the map of earlier trips under new ids, dense and in the order of the old ones, so that a
/// new trip's keyframes have other ids. Points get the edge mapper's space: a LocalMapper that
/// works on the archive continues after them. Keyframes get the space `keyframes`: the edge
/// mapper's if the new trip's tracker counts from one, or the tracker's if it starts in the
/// archive, so that later keyframes have larger ids. Features are shared.
std::shared_ptr<Map> archive(const Map& map, IdSpace keyframes = IdSpace::kEdgeMapper);

}  // namespace slambed
