// SPDX-License-Identifier: Apache-2.0
#include "slam/loop_correction.hpp"

#include <algorithm>

#include "map/appearance.hpp"

namespace slambed {
namespace {

/// Window at octave 0 for old points in the corrected keyframes (ORB-SLAM2, px).
constexpr float kRadius_px = 4;

}  // namespace

LoopCorrection LoopCorrector::correct(const Map& map, const LoopMatch& match) {
  LoopCorrection loop;
  loop.keyframe = match.keyframe;
  loop.matched = match.matched;
  targets_.clear();
  survivors_.clear();
  const bool there = map.read([&](const MapView& view) {
    const KeyFrame* current = view.keyframe(match.keyframe);
    if (!current || !view.keyframe(match.matched)) return false;
    loop.delta.epoch = view.epoch();
    std::vector<KeyFrameId> group{match.keyframe};
    for (const Covisible& near : current->covisibles) group.push_back(near.id);
    std::sort(group.begin(), group.end());
    const Sim3 T_wc = to_sim3(current->T_cw.inverse());
    for (const KeyFrameId id : group) {
      const KeyFrame& keyframe = *view.keyframe(id);
      const Sim3 before = to_sim3(keyframe.T_cw);
      const Sim3 after = normalized(before * T_wc * match.S_cw);
      loop.moved.push_back({id, before, after, keyframe.connected});
      loop.delta.poses.push_back({id, to_se3(after), keyframe.version + 1});
      targets_.push_back({copy_of(keyframe), to_se3(after)});
    }
    move_points(view, match, loop);
    loop_points_ = sketch_points(view, match.loop_points);
    return true;
  });
  if (!there) return loop;
  join_matches(match, loop);
  for (Target& target : targets_) join_projected(target, loop);
  return loop;
}

/// All keyframes of the group move by the same world transform, which also applies to their points.
void LoopCorrector::move_points(const MapView& view, const LoopMatch& match, LoopCorrection& loop) {
  const Sim3 change = match.S_cw.inverse() * to_sim3(view.keyframe(match.keyframe)->T_cw);
  for (const Target& target : targets_)
    for (const MapPointId id : target.keyframe.points)
      if (id && !std::binary_search(match.loop_points.begin(), match.loop_points.end(), id))
        loop.moved_points.push_back(id);
  std::sort(loop.moved_points.begin(), loop.moved_points.end());
  loop.moved_points.erase(std::unique(loop.moved_points.begin(), loop.moved_points.end()),
                          loop.moved_points.end());
  for (const MapPointId id : loop.moved_points) {
    const MapPoint& point = *view.point(id);
    loop.delta.positions.push_back({id, change * point.p_w, point.version + 1});
  }
}

MapPointId LoopCorrector::alive(MapPointId id) const {
  for (auto at = survivors_.find(id); at != survivors_.end(); at = survivors_.find(id))
    id = at->second;
  return id;
}

/// The feature sees the old point: attaches it, or fuses the feature's own point into it.
void LoopCorrector::join(Target& target, int feature, MapPointId old_point, LoopCorrection& loop) {
  const MapPointId mine = alive(target.keyframe.points[feature]);
  const MapPointId old = alive(old_point);
  if (mine == old) return;
  if (!mine) {
    loop.delta.attach.push_back({target.keyframe.id, static_cast<std::uint16_t>(feature), old});
  } else {
    loop.delta.fusions.push_back({mine, old});
    survivors_[mine] = old;
  }
  target.keyframe.points[feature] = old;
}

void LoopCorrector::join_matches(const LoopMatch& match, LoopCorrection& loop) {
  const auto current = std::find_if(targets_.begin(), targets_.end(), [&](const Target& target) {
    return target.keyframe.id == match.keyframe;
  });
  const std::size_t features = std::min(match.points.size(), current->keyframe.points.size());
  for (std::size_t i = 0; i < features; ++i)
    if (match.points[i]) join(*current, static_cast<int>(i), match.points[i], loop);
}

void LoopCorrector::join_projected(Target& target, LoopCorrection& loop) {
  const FeatureSet& features = *target.keyframe.features;
  const ScalePyramid& pyramid = features.sensor().pyramid;
  const Viewpoint camera(features.sensor(), target.T_cw);
  std::vector<MapPointId> seen;
  for (const MapPointId id : target.keyframe.points)
    if (id) seen.push_back(alive(id));
  std::sort(seen.begin(), seen.end());
  for (const PointSketch& point : loop_points_) {
    if (std::binary_search(seen.begin(), seen.end(), alive(point.id))) continue;
    Matcher::Query query;
    if (!camera.sees(point, query.at)) continue;
    const int octave = predict_octave(point.max_distance_m, query.at.distance_m, pyramid);
    query.radius_px = kRadius_px * pyramid.scale[octave];
    query.min_octave = std::max(0, octave - 1);
    query.max_octave = octave;
    query.descriptor = &point.descriptor;
    const Matcher::Best best = matcher_.search(features, query, [](int) { return true; });
    if (best.distance <= kHammingLow) join(target, best.feature, point.id, loop);
  }
}

}  // namespace slambed
