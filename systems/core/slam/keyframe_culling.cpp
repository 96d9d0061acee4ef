// SPDX-License-Identifier: Apache-2.0
#include "slam/keyframe_culling.hpp"

#include <algorithm>
#include <vector>

namespace slambed {
namespace {

constexpr int kMinOtherObservers = 3;
constexpr int kMinObservationWeight = 3;  ///< ORB-SLAM2's nObs > 3: a point is redundant above it
constexpr int kOctaveTolerance = 1;       ///< the others may see it one octave coarser

/// True if enough keyframes other than `own` see the point; those in `culled` no longer count.
bool seen_enough(const MapPoint& point, KeyFrameId own, int own_octave,
                 const std::vector<KeyFrameId>& culled) {
  if (point.weight <= kMinObservationWeight) return false;
  int weight = 0, others = 0;
  for (const Observation& at : point.observations) {
    if (std::find(culled.begin(), culled.end(), at.keyframe) != culled.end()) continue;
    weight += at.weight;
    others += at.keyframe != own && at.octave <= own_octave + kOctaveTolerance;
    if (weight > kMinObservationWeight && others >= kMinOtherObservers) return true;
  }
  return false;
}

/// True if more than redundant_share of the keyframe's points do not need it. Stops early, because
/// a few points usually show the opposite.
bool redundant(const MapView& view, const KeyFrame& keyframe, const std::vector<KeyFrameId>& culled,
               double redundant_share) {
  const Sensor& sensor = keyframe.features->sensor();
  const auto counts = [&](const KeyPoint& own) {
    return !sensor.metric() || (own.has_depth() && own.depth_m <= sensor.close_depth_m);
  };
  const auto keypoints = keyframe.features->keypoints();
  int counted = 0;
  for (std::size_t i = 0; i < keypoints.size(); ++i)
    counted += keyframe.points[i] && counts(keypoints[i]);
  const double enough = redundant_share * counted;
  int at_most = counted;  // points that may still turn out redundant
  for (std::size_t i = 0; i < keypoints.size() && at_most > enough; ++i)
    if (keyframe.points[i] && counts(keypoints[i]))
      at_most -=
          !seen_enough(*view.point(keyframe.points[i]), keyframe.id, keypoints[i].octave, culled);
  return at_most > enough;
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
  // One short read per candidate, so that no other worker waits long for the map.
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
