// SPDX-License-Identifier: Apache-2.0
#include "slam/map_correction.hpp"

namespace slambed {

void MapCorrection::move(KeyFrameId id, const Sim3& before, const Sim3& after) {
  moves_[id] = {before, after};
}

std::optional<Sim3> MapCorrection::change_at(const MapView& view, KeyFrameId id) const {
  while (id) {
    const auto move = moves_.find(id);
    if (move != moves_.end()) return move->second.after.inverse() * move->second.before;
    const KeyFrame* keyframe = view.keyframe(id);
    id = keyframe ? keyframe->parent : KeyFrameId{};
  }
  return std::nullopt;
}

MapDelta MapCorrection::delta(const MapView& view) const {
  MapDelta delta;
  delta.epoch = view.epoch();
  std::map<KeyFrameId, std::optional<Sim3>> changes;
  for (const KeyFrameId id : view.keyframe_ids()) {
    const KeyFrame& keyframe = *view.keyframe(id);
    const auto change = change_at(view, id);
    changes.emplace(id, change);
    if (!change) continue;
    const auto move = moves_.find(id);
    const Sim3 after = move != moves_.end()
                           ? move->second.after
                           : normalized(to_sim3(keyframe.T_cw) * change->inverse());
    delta.poses.push_back({id, to_se3(after), keyframe.version + 1});
  }
  for (const MapPointId id : view.point_ids()) {
    const MapPoint& point = *view.point(id);
    if (const auto place = placed_.find(id); place != placed_.end()) {
      delta.positions.push_back({id, place->second, point.version + 1});
      continue;
    }
    KeyFrameId with = point.reference;
    if (const auto anchor = anchors_.find(id); anchor != anchors_.end()) with = anchor->second;
    auto change = changes.find(with);
    if (change == changes.end() && !point.observations.empty())
      change = changes.find(point.observations.front().keyframe);
    if (change == changes.end() || !change->second) continue;
    delta.positions.push_back({id, *change->second * point.p_w, point.version + 1});
  }
  return delta;
}

}  // namespace slambed
