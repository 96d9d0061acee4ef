// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// A whole map as one delta: committed to an empty map it gives the same map again, but for the
/// memory of what was culled and fused. The origin comes first, then everything in ascending order.
MapDelta snapshot(const MapView& map);

}  // namespace slambed
