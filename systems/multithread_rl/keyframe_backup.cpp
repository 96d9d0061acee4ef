// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/keyframe_backup.hpp"

#include <algorithm>
#include <array>
#include <set>

#include "offload/maps/update_content.hpp"
#include "slam/map_change.hpp"

namespace slambed {
namespace {

struct Made {
  MapDelta delta;                    ///< the keyframe with all its points
  std::vector<Covisible> connected;  ///< most shared points first
};

/// Returns whether the keyframe counts as an observation of all points that it lists.
bool observes_all(const MapView& view, const KeyFrame& keyframe) {
  return std::all_of(keyframe.points.begin(), keyframe.points.end(), [&](MapPointId id) {
    if (!id) return true;
    const auto& seen = view.point(id)->observations;
    const auto own = std::find_if(seen.begin(), seen.end(),
                                  [&](const Observation& o) { return o.keyframe == keyframe.id; });
    return own->weight > 0;
  });
}

Made made(const Map& from, KeyFrameId id) {
  return from.read([&](const MapView& view) {
    Made found;
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) return found;
    found.delta = extract_keyframes(view, std::array{id});
    found.delta.keyframes[0].observes_known = observes_all(view, *keyframe);
    found.connected = keyframe->connected;
    std::stable_sort(found.connected.begin(), found.connected.end(),
                     [](const Covisible& a, const Covisible& b) { return a.weight > b.weight; });
    return found;
  });
}

const SE3& movement_of(const Made& made, const SharedKeyFrames& shared) {
  for (const Covisible& near : made.connected) {
    if (const SE3* movement = shared.movement(near.id)) return *movement;
  }
  return shared.newest();
}

}  // namespace

SharedKeyFrames::SharedKeyFrames(const Map& from, const Map& to) {
  std::vector<std::pair<KeyFrameId, SE3>> old_poses;
  from.read([&](const MapView& view) {
    for (const KeyFrameId id : view.keyframe_ids())
      old_poses.emplace_back(id, view.keyframe(id)->T_cw);
    return 0;
  });
  to.read([&](const MapView& view) {
    for (const auto& [id, old_T_cw] : old_poses) {
      const KeyFrame* keyframe = view.keyframe(id);
      if (!keyframe) continue;
      newest_ = (keyframe->T_cw.inverse() * old_T_cw).normalized();
      movements_[id] = newest_;
    }
    return 0;
  });
}

const SE3* SharedKeyFrames::movement(KeyFrameId keyframe) const {
  const auto found = movements_.find(keyframe);
  return found == movements_.end() ? nullptr : &found->second;
}

MapDelta carry_over(const Map& from, const Map& to, KeyFrameId id, SharedKeyFrames& shared) {
  if (to.read([&](const MapView& view) { return view.keyframe(id) != nullptr; })) return {};
  Made here = made(from, id);
  if (here.delta.keyframes.empty()) return {};
  const SE3 T_new_old = movement_of(here, shared);
  NewKeyFrame& keyframe = here.delta.keyframes.front();
  keyframe.T_cw = (keyframe.T_cw * T_new_old.inverse()).normalized();

  std::vector<MapPointId> there = keyframe.points;
  rename_points(from, to, there);
  std::set<MapPointId> seen, lacking;
  for (std::size_t i = 0; i < there.size(); ++i) {
    MapPointId& point = keyframe.points[i];
    if (!point) continue;
    const MapPointId old = point;
    if (there[i]) point = there[i];
    if (!seen.insert(point).second) {
      point = {};  // two of its points were fused in `to`
    } else if (!there[i]) {
      lacking.insert(old);
    }
  }
  std::erase_if(here.delta.points,
                [&](const NewPoint& point) { return !lacking.contains(point.id); });
  for (NewPoint& point : here.delta.points) {
    point.p_w = T_new_old * point.p_w;
    point.appearance.normal = T_new_old.R.cast<float>() * point.appearance.normal;
  }
  shared.add(id, T_new_old);
  return std::move(here.delta);
}

}  // namespace slambed
