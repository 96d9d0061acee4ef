// SPDX-License-Identifier: Apache-2.0
#include "slam/keyframe_maker.hpp"

#include <algorithm>

#include "map/appearance.hpp"

namespace slambed {
namespace {

/// Number of nearest features that get a point even if they are not close (ORB-SLAM2).
constexpr int kNearestWanted = 100;

/// Brings the frame's matches up to date: fused points are replaced, each point stays only once.
void refresh_matches(const Map& map, Frame& frame) {
  std::vector<MapPointId> seen;
  map.read([&](const MapView& view) {
    for (MapPointId& id : frame.points) {
      if (id) id = view.resolve(id);
      if (id) seen.push_back(id);
    }
    return 0;
  });
  std::sort(seen.begin(), seen.end());
  if (std::adjacent_find(seen.begin(), seen.end()) == seen.end()) return;
  seen.clear();
  for (MapPointId& id : frame.points) {
    if (!id) continue;
    const auto place = std::lower_bound(seen.begin(), seen.end(), id);
    if (place != seen.end() && *place == id)
      id = {};
    else
      seen.insert(place, id);
  }
}

}  // namespace

MapDelta make_keyframe(const Map& map, Frame& frame, const SE3& T_cw, NewPoints rule,
                       TrackerIds& ids) {
  refresh_matches(map, frame);
  const FeatureSet& features = *frame.features;
  const Sensor& sensor = features.sensor();
  std::vector<int> by_depth;
  for (int i = 0; i < features.size(); ++i)
    if (features.keypoint(i).has_depth()) by_depth.push_back(i);
  std::stable_sort(by_depth.begin(), by_depth.end(), [&](int a, int b) {
    return features.keypoint(a).depth_m < features.keypoint(b).depth_m;
  });

  MapDelta delta;
  NewKeyFrame keyframe;
  keyframe.id = ids.keyframes.next();
  const SE3 T_wc = T_cw.inverse();
  int counted = 0;
  for (const int i : by_depth) {
    const KeyPoint& seen = features.keypoint(i);
    if (rule == NewPoints::kCloseOrNearest && seen.depth_m > sensor.close_depth_m &&
        counted > kNearestWanted)
      break;
    ++counted;
    if (frame.points[i]) continue;
    NewPoint point;
    point.id = ids.points.next();
    point.p_w = T_wc * sensor.camera.unproject(seen.u, seen.v, seen.depth_m);
    point.appearance = appearance_of(point.p_w, T_cw, features, i);
    point.reference = point.first_keyframe = keyframe.id;
    frame.match(i, point.id, point.p_w);
    delta.points.push_back(point);
  }
  keyframe.frame_index = frame.index;
  keyframe.timestamp_s = frame.timestamp_s;
  keyframe.features = frame.features;
  keyframe.T_cw = T_cw;
  keyframe.points = frame.points;
  delta.keyframes.push_back(std::move(keyframe));
  return delta;
}

}  // namespace slambed
