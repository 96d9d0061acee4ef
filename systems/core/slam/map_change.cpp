// SPDX-License-Identifier: Apache-2.0
#include "slam/map_change.hpp"

#include <algorithm>
#include <iterator>
#include <vector>

namespace slambed {

namespace {

void apply(const MapChangeOptions& options, KeyFrameId old_reference, const Map& new_map,
           MapChange& change) {
  const std::vector<KeyFrameId> all =
      new_map.read([](const MapView& view) { return view.keyframe_ids(); });
  if (all.empty()) return;
  if (options.only_from_newest && old_reference != all.back()) change.T_old_new = SE3();
  if (!options.newest_is_reference) return;
  change.reference = all.back();
  change.T_rw = new_map.read([&](const MapView& view) { return view.keyframe(all.back())->T_cw; });
}

MapChange shared_keyframe(const Map& old_map, const Map& new_map, KeyFrameId old_reference) {
  struct KnownPose {
    KeyFrameId id;
    SE3 T_cw;
  };
  // In order of preference: the reference itself, its covisibles, then all keyframes, newest first.
  const std::vector<KnownPose> known = old_map.read([&](const MapView& view) {
    std::vector<KnownPose> list;
    if (const auto pose = view.pose_of(old_reference)) list.push_back({old_reference, *pose});
    if (const KeyFrame* keyframe = view.keyframe(old_reference))
      for (const Covisible& near : keyframe->covisibles)
        list.push_back({near.id, view.keyframe(near.id)->T_cw});
    const std::vector<KeyFrameId> all = view.keyframe_ids();
    for (auto id = all.rbegin(); id != all.rend(); ++id)
      list.push_back({*id, view.keyframe(*id)->T_cw});
    return list;
  });
  return new_map.read([&](const MapView& view) {
    MapChange change;
    for (const KnownPose& old : known) {
      const KeyFrame* keyframe = view.keyframe(old.id);
      if (!keyframe) continue;
      change.reference = old.id;
      change.T_rw = keyframe->T_cw;
      change.T_old_new = (old.T_cw.inverse() * keyframe->T_cw).normalized();
      change.shared = true;
      return change;
    }
    if (view.keyframe_count() > 0) {
      change.reference = view.keyframe_ids().back();
      change.T_rw = view.keyframe(change.reference)->T_cw;
    }
    return change;
  });
}

}  // namespace

MapChange compare_maps(const Map& old_map, const Map& new_map, KeyFrameId old_reference,
                       const MapChangeOptions& options) {
  MapChange change = shared_keyframe(old_map, new_map, old_reference);
  if (options.newest_is_reference || options.only_from_newest)
    apply(options, old_reference, new_map, change);
  return change;
}

void keep_tracked_points(const Map& new_map, std::span<MapPointId> points) {
  new_map.read([&](const MapView& view) {
    for (MapPointId& id : points)
      if (id && (space_of(id) != IdSpace::kTracker || !view.point(id))) id = {};
    return 0;
  });
}

void hand_out_by_rank(std::span<MapPointId> points) {
  std::vector<MapPointId> ids;
  std::copy_if(points.begin(), points.end(), std::back_inserter(ids),
               [](MapPointId id) { return static_cast<bool>(id); });
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i]) points[i] = i < ids.size() ? ids[i] : MapPointId{};
}

void rename_points(const Map& old_map, const Map& new_map, std::span<MapPointId> points) {
  std::vector<std::size_t> missing;
  new_map.read([&](const MapView& view) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!points[i]) continue;
      if (const MapPointId id = view.resolve(points[i]))
        points[i] = id;
      else
        missing.push_back(i);
    }
    return 0;
  });
  std::vector<std::vector<Observation>> seen(missing.size());
  old_map.read([&](const MapView& view) {
    for (std::size_t k = 0; k < missing.size(); ++k)
      if (const MapPoint* point = view.point(view.resolve(points[missing[k]])))
        seen[k] = point->observations;
    return 0;
  });
  new_map.read([&](const MapView& view) {
    for (std::size_t k = 0; k < missing.size(); ++k) {
      MapPointId& id = points[missing[k]];
      id = {};
      for (const Observation& at : seen[k]) {
        const KeyFrame* keyframe = view.keyframe(at.keyframe);
        if (keyframe && at.feature < keyframe->points.size() && keyframe->points[at.feature])
          id = keyframe->points[at.feature];
      }
    }
    return 0;
  });
}

}  // namespace slambed
