// SPDX-License-Identifier: Apache-2.0
#include "map/map_snapshot.hpp"

#include <algorithm>

namespace slambed {

MapDelta snapshot(const MapView& map) {
  MapDelta delta;
  delta.epoch = map.epoch();
  std::vector<KeyFrameId> keyframes = map.keyframe_ids();
  // The first keyframe committed to an empty map becomes its origin, so the origin goes first.
  const auto origin = std::find(keyframes.begin(), keyframes.end(), map.origin());
  if (origin != keyframes.end()) std::rotate(keyframes.begin(), origin, origin + 1);
  delta.keyframes.reserve(keyframes.size());
  for (const KeyFrameId id : keyframes) {
    const KeyFrame& k = *map.keyframe(id);
    delta.keyframes.push_back({.id = id,
                               .frame_index = k.frame_index,
                               .timestamp_s = k.timestamp_s,
                               .features = k.features,
                               .T_cw = k.T_cw,
                               .points = k.points,
                               .parent = k.parent,
                               .version = k.version});
  }
  const std::vector<MapPointId> points = map.point_ids();
  delta.points.reserve(points.size());
  for (const MapPointId id : points) {
    const MapPoint& p = *map.point(id);
    delta.points.push_back({.id = id,
                            .p_w = p.p_w,
                            .appearance = p.appearance,
                            .reference = p.reference,
                            .first_keyframe = p.first_keyframe,
                            .visible = p.visible,
                            .found = p.found,
                            .version = p.version});
  }
  return delta;
}

}  // namespace slambed
