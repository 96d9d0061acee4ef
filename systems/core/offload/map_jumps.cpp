// SPDX-License-Identifier: Apache-2.0
#include "offload/map_jumps.hpp"

#include <algorithm>

namespace slambed {

MapJumps::Poses MapJumps::poses(const Map& map) {
  return map.read([](const MapView& view) {
    Poses found;
    for (const KeyFrameId id : view.keyframe_ids()) found[id] = view.keyframe(id)->T_cw;
    return found;
  });
}

void MapJumps::note(const Map& map, std::uint64_t updates, Poses before) {
  const bool moved = map.read([&](const MapView& view) {
    return std::any_of(before.begin(), before.end(), [&](const auto& known) {
      const KeyFrame* keyframe = view.keyframe(known.first);
      return keyframe &&
             (keyframe->T_cw.R != known.second.R || keyframe->T_cw.t != known.second.t);
    });
  });
  if (!moved) return;
  std::lock_guard lock(mutex_);
  jumps_.push_back({updates, std::move(before)});
}

void MapJumps::forget() {
  std::lock_guard lock(mutex_);
  jumps_.clear();
}

MapDelta MapJumps::follow(const MapView& map, MapDelta made, std::uint64_t applied) {
  std::lock_guard lock(mutex_);
  while (!jumps_.empty() && jumps_.front().updates < applied) jumps_.pop_front();
  if (jumps_.empty()) return made;
  Poses& before = jumps_.front().before;
  NewKeyFrame& keyframe = made.keyframes.front();
  std::map<KeyFrameId, int> shared;
  for (const MapPointId id : keyframe.points) {
    const MapPoint* point = id ? map.point(map.resolve(id)) : nullptr;
    if (!point) continue;
    for (const Observation& seen : point->observations) {
      if (before.contains(seen.keyframe)) ++shared[seen.keyframe];
    }
  }
  const auto guide = std::max_element(
      shared.begin(), shared.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (guide == shared.end()) return made;
  const SE3 T_new_old = map.keyframe(guide->first)->T_cw.inverse() * before.at(guide->first);
  before[keyframe.id] = keyframe.T_cw;
  keyframe.T_cw = keyframe.T_cw * T_new_old.inverse();
  for (NewPoint& point : made.points) {
    point.p_w = T_new_old * point.p_w;
    point.appearance.normal = T_new_old.R.cast<float>() * point.appearance.normal;
  }
  return made;
}

}  // namespace slambed
