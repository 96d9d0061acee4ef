// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <vector>

#include "map/map.hpp"

namespace slambed {

/// A keyframe's data, copied in one short read so that mapping does not hold the map.
struct KeyFrameCopy {
  KeyFrameId id;
  std::shared_ptr<const FeatureSet> features;
  SE3 T_cw;
  std::vector<MapPointId> points;
};

inline KeyFrameCopy copy_of(const KeyFrame& keyframe) {
  return {keyframe.id, keyframe.features, keyframe.T_cw, keyframe.points};
}

/// The `count` keyframes that share the most points with this one.
inline std::vector<KeyFrameId> best_covisibles(const KeyFrame& keyframe, int count) {
  std::vector<KeyFrameId> best;
  const std::size_t n =
      std::min(keyframe.covisibles.size(), static_cast<std::size_t>(std::max(0, count)));
  best.reserve(n);
  for (std::size_t i = 0; i < n; ++i) best.push_back(keyframe.covisibles[i].id);
  return best;
}

}  // namespace slambed
