// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/labels.hpp"

#include <set>

namespace slambed::edgeslam_semantic {

std::vector<std::uint8_t> features_on_masks(const FeatureSet& features, const FrameMasks& masks,
                                            int border_px) {
  std::vector<std::uint8_t> moves = features_off_masks(features, masks, border_px);
  for (std::uint8_t& one : moves) one = one ? 0 : 1;
  return moves;
}

MapDelta without_labeled(const MapView& view, const Labels& labels) {
  std::map<MapPointId, std::vector<ObservationEdit>> observations;
  for (const auto& [id, moves] : labels) {
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) continue;
    for (std::size_t i = 0; i < moves.size() && i < keyframe->points.size(); ++i) {
      const MapPointId point = keyframe->points[i];
      if (moves[i] && point)
        observations[point].push_back({id, static_cast<std::uint16_t>(i), point});
    }
  }
  MapDelta delta;
  delta.epoch = view.epoch();
  for (const auto& [id, labeled] : observations) {
    if (2 * labeled.size() >= view.point(id)->observations.size()) {
      delta.culled_points.push_back(id);
    } else {
      delta.detach.insert(delta.detach.end(), labeled.begin(), labeled.end());
    }
  }
  return delta;
}

}  // namespace slambed::edgeslam_semantic
