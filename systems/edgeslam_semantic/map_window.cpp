// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/map_window.hpp"

namespace slambed::edgeslam_semantic {
namespace {

/// Rounds as a slice does, which carries positions as 32-bit floats. The float is volatile because
/// GCC 12 at -O3 optimizes away two adjacent roundings.
double as_sent(double value) {
  const volatile float sent = static_cast<float>(value);
  return sent;
}
Eigen::Vector3d as_sent(const Eigen::Vector3d& p_w) {
  return {as_sent(p_w.x()), as_sent(p_w.y()), as_sent(p_w.z())};
}

bool same_pose(const SE3& a, const SE3& b) { return a.R == b.R && a.t == b.t; }

void add_observations(KeyFrameId id, const MapWindow::ObservedKeyFrame* before,
                      const MapWindow::ObservedKeyFrame& now, MapDelta& changes) {
  if (before) {
    for (const auto& [feature, point] : before->points)
      if (!now.points.contains(feature)) changes.detach.push_back({id, feature, point});
  }
  for (const auto& [feature, point] : now.points) {
    const auto known = before ? before->points.find(feature) : now.points.end();
    const bool same = before && known != before->points.end() && known->second == point;
    if (!same) changes.attach.push_back({id, feature, point});
  }
}

}  // namespace

MapWindow window_of(const MapView& view, std::span<const KeyFrameId> keyframes) {
  MapWindow window;
  for (const KeyFrameId id : keyframes) {
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) continue;
    MapWindow::ObservedKeyFrame& observed = window.keyframes[id];
    observed.T_cw = keyframe->T_cw;
    for (std::size_t i = 0; i < keyframe->points.size(); ++i) {
      const MapPointId point = keyframe->points[i];
      if (!point) continue;
      observed.points[static_cast<std::uint16_t>(i)] = point;
      window.points.emplace(point, as_sent(view.point(point)->p_w));
    }
  }
  return window;
}

MapSlice difference(const MapWindow& before, const MapWindow& now, const MapView& view) {
  MapSlice slice;
  slice.changes.epoch = view.epoch();
  for (const auto& [id, p_w] : now.points) {
    const auto known = before.points.find(id);
    if (known == before.points.end() || known->second != p_w)
      slice.changes.positions.push_back({id, p_w, 0});
  }
  for (const auto& [id, observed] : now.keyframes) {
    const auto found = before.keyframes.find(id);
    const MapWindow::ObservedKeyFrame* known =
        found == before.keyframes.end() ? nullptr : &found->second;
    if (!known || !same_pose(known->T_cw, observed.T_cw))
      slice.changes.poses.push_back({id, observed.T_cw, 0});
    add_observations(id, known, observed, slice.changes);
  }
  for (const auto& [id, observed] : before.keyframes) {
    if (now.keyframes.contains(id)) continue;
    (view.keyframe(id) ? slice.left_keyframes : slice.changes.culled_keyframes).push_back(id);
  }
  for (const auto& [id, p_w] : before.points) {
    if (now.points.contains(id)) continue;
    if (view.point(id)) {
      slice.left_points.push_back(id);
    } else if (const MapPointId survivor = view.resolve(id)) {
      slice.changes.fusions.push_back({id, survivor});
    } else {
      slice.changes.culled_points.push_back(id);
    }
  }
  return slice;
}

void apply(MapWindow& window, const MapSlice& slice) {
  const MapDelta& changes = slice.changes;
  for (const PointPosition& point : changes.positions) window.points[point.id] = point.p_w;
  for (const KeyFramePose& pose : changes.poses) window.keyframes[pose.id].T_cw = pose.T_cw;
  // Detach first: a point may have moved to another feature of the same keyframe.
  for (const ObservationEdit& edit : changes.detach) {
    const auto keyframe = window.keyframes.find(edit.keyframe);
    if (keyframe != window.keyframes.end()) keyframe->second.points.erase(edit.feature);
  }
  for (const ObservationEdit& edit : changes.attach) {
    const auto keyframe = window.keyframes.find(edit.keyframe);
    if (keyframe != window.keyframes.end() && window.points.contains(edit.point))
      keyframe->second.points[edit.feature] = edit.point;
  }
  for (const auto* gone : {&changes.culled_keyframes, &slice.left_keyframes})
    for (const KeyFrameId id : *gone) window.keyframes.erase(id);
  for (const auto* gone : {&changes.culled_points, &slice.left_points})
    for (const MapPointId id : *gone) window.points.erase(id);
  for (const PointFusion& fusion : changes.fusions) window.points.erase(fusion.gone);
  // difference() detaches these observations, but a message from a peer may not.
  for (auto& [id, observed] : window.keyframes)
    std::erase_if(observed.points,
                  [&](const auto& seen) { return !window.points.contains(seen.second); });
}

}  // namespace slambed::edgeslam_semantic
