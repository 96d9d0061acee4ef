// SPDX-License-Identifier: Apache-2.0
#include "map/map_delta.hpp"

namespace slambed {

bool MapDelta::empty() const {
  return points.empty() && keyframes.empty() && attach.empty() && detach.empty() &&
         fusions.empty() && positions.empty() && poses.empty() && observation_counts.empty() &&
         culled_points.empty() && culled_keyframes.empty();
}

}  // namespace slambed
