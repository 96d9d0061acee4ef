// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

struct MapCounts {
  std::size_t keyframes = 0, points = 0;
};

inline MapCounts count(const Map& map) {
  return map.read([](const MapView& view) {
    return MapCounts{view.keyframe_count(), view.point_count()};
  });
}

}  // namespace slambed
