// SPDX-License-Identifier: Apache-2.0
#include "offload/edge/loop_correction_log.hpp"

#include <algorithm>

namespace slambed {
namespace {

using Poses = std::map<KeyFrameId, SE3>;

Poses poses(const MapView& view) {
  Poses found;
  for (const KeyFrameId id : view.keyframe_ids()) found[id] = view.keyframe(id)->T_cw;
  return found;
}

bool moved(const MapView& view, const Poses& before) {
  return std::any_of(before.begin(), before.end(), [&](const auto& known) {
    const KeyFrame* keyframe = view.keyframe(known.first);
    return keyframe && (keyframe->T_cw.R != known.second.R || keyframe->T_cw.t != known.second.t);
  });
}

/// Returns the keyframe in `before` that shares the most points with this one, or none.
KeyFrameId closest_of(const MapView& view, const NewKeyFrame& keyframe, const Poses& before) {
  std::map<KeyFrameId, int> shared;
  for (const MapPointId id : keyframe.points) {
    const MapPoint* point = id ? view.point(view.resolve(id)) : nullptr;
    if (!point) continue;
    for (const Observation& seen : point->observations) {
      if (before.contains(seen.keyframe)) ++shared[seen.keyframe];
    }
  }
  const auto most =
      std::max_element(shared.begin(), shared.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == shared.end() ? KeyFrameId{} : most->first;
}

}  // namespace

void LoopCorrectionLog::commit(Map& map, const MapDelta& delta) {
  std::lock_guard lock(mutex_);
  Poses before = map.read(poses);
  map.commit(delta);
  if (map.read([&](const MapView& view) { return moved(view, before); })) {
    corrections_.push_back({updates_, std::move(before)});
    ++count_;
  }
}

void LoopCorrectionLog::forget() {
  std::lock_guard lock(mutex_);
  corrections_.clear();
}

MapDelta LoopCorrectionLog::correct(const Map& map, MapDelta made, std::uint64_t applied) {
  std::lock_guard lock(mutex_);
  while (!corrections_.empty() && corrections_.front().updates < applied) corrections_.pop_front();
  if (corrections_.empty()) return made;
  Poses& before = corrections_.front().before;
  return map.read([&](const MapView& view) {
    const KeyFrameId closest = closest_of(view, made.keyframes.front(), before);
    if (!closest) return made;
    const SE3 T_new_old = view.keyframe(closest)->T_cw.inverse() * before.at(closest);
    for (NewKeyFrame& keyframe : made.keyframes) {
      before[keyframe.id] = keyframe.T_cw;
      keyframe.T_cw = keyframe.T_cw * T_new_old.inverse();
    }
    for (NewPoint& point : made.points) {
      point.p_w = T_new_old * point.p_w;
      point.appearance.normal = T_new_old.R.cast<float>() * point.appearance.normal;
    }
    return made;
  });
}

}  // namespace slambed
