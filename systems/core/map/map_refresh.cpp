// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "map/map_state.hpp"

namespace slambed {
namespace {

/// A weaker covisibility edge is listed only if the keyframe has no stronger one.
constexpr int kStrongCovisibility = 15;
/// A point that lost an observation and keeps at most one stereo or two mono ones is culled.
constexpr int kMinWeight = 2;

}  // namespace

void MapState::finish() {
  // Iterates by index. Culling a point touches keyframes but never adds touched points.
  for (std::size_t i = 0; i < touched_points_.size(); ++i) {
    const Touch touched = touched_points_[i];
    PointSlot& slot = *points_.find(touched.id);
    if (slot.live && slot.live->weight < touched.weight_before && slot.live->weight <= kMinWeight)
      cull(touched.id);
    if (slot.live) refresh_point(touched);
    slot.touch = 0;
  }
  touched_points_.clear();

  for (const KeyFrameId id : touched_keyframes_)
    if (Node* keyframe = node(id)) refresh_covisibles(*keyframe);
  adopt_orphans();
  for (const KeyFrameId id : touched_keyframes_)
    if (Node* keyframe = node(id)) keyframe->touched = false;
  touched_keyframes_.clear();
}

void MapState::refresh_point(const Touch& touched) {
  MapPoint& point = *live_point(touched.id);
  Appearance& appearance = point.appearance;
  const bool given = touched.fresh && appearance.max_distance_m > 0;
  if (given || point.weight == 0) return;
  if (!touched.observations && !touched.position) return;

  Eigen::Vector3d directions = Eigen::Vector3d::Zero();
  seen_as_.clear();
  for (const Observation& seen : point.observations) {
    if (seen.weight == 0) continue;
    const Node& keyframe = *node(seen.keyframe);
    const Eigen::Vector3d ray = point.p_w + keyframe.minus_center;
    const double distance_m = ray.norm();
    if (distance_m > 0) directions += ray / distance_m;
    seen_as_.push_back(&keyframe.features->descriptor(seen.feature));
    if (seen.keyframe == point.reference) {
      const DistanceRange range =
          distance_range(distance_m, keyframe.features->keypoint(seen.feature).octave,
                         keyframe.features->sensor().pyramid);
      appearance.min_distance_m = range.min_m;
      appearance.max_distance_m = range.max_m;
    }
  }
  appearance.normal = (directions / static_cast<double>(seen_as_.size())).cast<float>();
  if (touched.observations) appearance.descriptor = *seen_as_[chooser_.choose(seen_as_)];
}

void MapState::refresh_covisibles(Node& keyframe) {
  // Heaviest first. Among equals the newest goes first, because it is likely the closest in time.
  const auto heavier = [](const Covisible& a, const Covisible& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.id > b.id;
  };
  auto& list = keyframe.covisibles;
  list.clear();
  for (const Covisible& other : keyframe.connected)
    if (other.weight >= kStrongCovisibility) list.push_back(other);
  if (list.empty() && !keyframe.connected.empty())
    list.push_back(
        *std::min_element(keyframe.connected.begin(), keyframe.connected.end(), heavier));
  std::sort(list.begin(), list.end(), heavier);
}

}  // namespace slambed
