// SPDX-License-Identifier: Apache-2.0
#include "offload/maps/update_content.hpp"

#include <algorithm>
#include <set>

namespace slambed {

std::vector<KeyFrameId> keyframes_of(const MapDelta& delta) {
  std::vector<KeyFrameId> ids;
  for (const NewKeyFrame& keyframe : delta.keyframes) ids.push_back(keyframe.id);
  std::sort(ids.begin(), ids.end());
  return ids;
}

MapDelta extract_keyframes(const MapView& view, std::span<const KeyFrameId> keyframes) {
  const std::set<KeyFrameId> wanted(keyframes.begin(), keyframes.end());
  MapDelta delta;
  std::set<MapPointId> points;
  for (const KeyFrameId id : wanted) {
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) continue;
    const KeyFrameId parent = wanted.contains(keyframe->parent) ? keyframe->parent : KeyFrameId{};
    delta.keyframes.push_back({.id = id,
                               .frame_index = keyframe->frame_index,
                               .timestamp_s = keyframe->timestamp_s,
                               .features = keyframe->features,
                               .T_cw = keyframe->T_cw,
                               .points = keyframe->points,
                               .parent = parent,
                               .version = keyframe->version});
    for (const MapPointId point : keyframe->points) {
      if (point) points.insert(point);
    }
  }
  for (const MapPointId id : points) {
    const MapPoint* point = view.point(id);
    if (!point) continue;
    delta.points.push_back({.id = id,
                            .p_w = point->p_w,
                            .appearance = point->appearance,
                            .reference = point->reference,
                            .first_keyframe = point->first_keyframe,
                            .visible = point->visible,
                            .found = point->found,
                            .version = point->version});
  }
  return delta;
}

std::vector<KeyFrameId> with_covisibles(const MapView& view, std::vector<KeyFrameId> keyframes,
                                        int count) {
  const std::size_t given = keyframes.size();
  for (std::size_t i = 0; i < given; ++i) {
    const KeyFrame* keyframe = view.keyframe(keyframes[i]);
    if (!keyframe) continue;
    const auto best =
        std::min<std::size_t>(keyframe->covisibles.size(), static_cast<std::size_t>(count));
    for (std::size_t c = 0; c < best; ++c) {
      const KeyFrameId id = keyframe->covisibles[c].id;
      if (std::find(keyframes.begin(), keyframes.end(), id) == keyframes.end()) {
        keyframes.push_back(id);
      }
    }
  }
  return keyframes;
}

}  // namespace slambed
