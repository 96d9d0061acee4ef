// SPDX-License-Identifier: Apache-2.0
#include "slam/keyframe_culling.hpp"

#include <algorithm>
#include <vector>

namespace slambed {
namespace {

constexpr int kOtherObservers = 3;
constexpr int kRedundantAbove = 3;   ///< a point can only be redundant above this weight
constexpr int kOctaveTolerance = 1;  ///< the others may see it one octave coarser

/// How the points of one keyframe fare without it; `culled` are gone already.
bool redundant(const MapView& view, const KeyFrame& keyframe, const std::vector<KeyFrameId>& culled,
               double redundant_share) {
  const auto is_culled = [&](KeyFrameId id) {
    return std::find(culled.begin(), culled.end(), id) != culled.end();
  };
  const Sensor& sensor = keyframe.features->sensor();
  int counted = 0, redundant_points = 0;
  for (std::size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    const KeyPoint& own = keyframe.features->keypoint(static_cast<int>(i));
    if (sensor.metric() && (!own.has_depth() || own.depth_m > sensor.close_depth_m)) continue;
    const MapPoint& point = *view.point(keyframe.points[i]);
    ++counted;
    if (point.weight <= kRedundantAbove) continue;
    int weight = 0, others = 0;
    for (const Observation& at : point.observations) {
      if (!culled.empty() && is_culled(at.keyframe)) continue;
      const KeyPoint& seen = view.keyframe(at.keyframe)->features->keypoint(at.feature);
      weight += seen.right_u >= 0 ? 2 : 1;
      others += at.keyframe != keyframe.id && seen.octave <= own.octave + kOctaveTolerance;
    }
    redundant_points += weight > kRedundantAbove && others >= kOtherObservers;
  }
  return redundant_points > redundant_share * counted;
}

}  // namespace

MapDelta redundant_keyframes(const Map& map, KeyFrameId keyframe, double redundant_share) {
  MapDelta delta;
  std::vector<KeyFrameId> candidates;
  map.read([&](const MapView& view) {
    delta.epoch = view.epoch();
    if (const KeyFrame* current = view.keyframe(keyframe))
      for (const Covisible& near : current->covisibles)
        if (near.id != view.origin()) candidates.push_back(near.id);
    return 0;
  });
  // One short read per candidate: nothing else waits long for the map.
  for (const KeyFrameId id : candidates) {
    const bool cull = map.read([&](const MapView& view) {
      const KeyFrame* candidate = view.keyframe(id);
      return candidate && redundant(view, *candidate, delta.culled_keyframes, redundant_share);
    });
    if (cull) delta.culled_keyframes.push_back(id);
  }
  return delta;
}

}  // namespace slambed
