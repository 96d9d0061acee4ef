// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// Returns a whole map as one delta. Committed to an empty map, it gives the same map without the
/// records of culled and fused elements. The origin comes first, then all others by ascending id.
MapDelta snapshot(const MapView& map);

}  // namespace slambed
