// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "multithread_rl/map_staging.hpp"
#include "offload/maps/update_content.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::testing {

inline SE3 small_motion(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> unit(-size, size);
  Eigen::Matrix<double, 6, 1> step;
  for (int i = 0; i < 6; ++i) step[i] = unit(random);
  return SE3::exp(step);
}

/// A mobile that makes keyframes on its active map, and an edge that has mapped the first of them.
/// The edge's world has moved, and some points were fused or culled there.
class StagingScenario {
 public:
  static constexpr int kFeatures = 24, kNewPoints = 8;

  explicit StagingScenario(unsigned seed, MapStaging::Backup backup = MapStaging::Backup::kUpdate,
                           int recovery_keyframes = 0)
      : random_(seed),
        features_(wire::example_features(random_, kFeatures, wire::example_camera().make_sensor())),
        staging(std::make_shared<Map>(), backup, recovery_keyframes) {}

  /// Half of its points are seen by the previous keyframe, too.
  void make_keyframe(bool provisional) {
    MapDelta delta;
    NewKeyFrame keyframe;
    keyframe.id = wire::keyframe_id(++made);
    keyframe.features = features_;
    keyframe.T_cw = T_cw;
    keyframe.points.assign(kFeatures, {});
    for (int i = 0; i < kFeatures - kNewPoints; ++i) {
      if (!before_.empty() && i < std::ssize(before_)) keyframe.points[i] = before_[i];
    }
    for (int i = 0; i < kNewPoints; ++i) {
      NewPoint point;
      point.id = wire::point_id(++points_);
      point.p_w = T_cw.inverse() * Eigen::Vector3d(0.1 * i, 0.2, 2 + i % 3);
      point.reference = point.first_keyframe = keyframe.id;
      keyframe.points[kFeatures - 1 - i] = point.id;
      delta.points.push_back(point);
    }
    before_.assign(keyframe.points.rbegin(), keyframe.points.rend());
    // A keyframe sees each point only once.
    std::set<MapPointId> seen;
    for (MapPointId& id : keyframe.points)
      if (id && !seen.insert(id).second) id = {};
    // Points that were lost with an earlier map are not seen any more.
    staging.active()->read([&](const MapView& view) {
      for (MapPointId& id : keyframe.points) {
        const bool fresh = std::any_of(delta.points.begin(), delta.points.end(),
                                       [&](const NewPoint& p) { return p.id == id; });
        if (id && !fresh) id = view.resolve(id);
      }
      return 0;
    });
    delta.keyframes.push_back(std::move(keyframe));
    staging.active()->commit(delta);
    staging.keyframe_created(wire::keyframe_id(made), provisional);
    T_cw = small_motion(random_, 0.1) * T_cw;
  }

  /// Makes an update of the latest keyframes up to this one from the edge's map.
  MapDelta update(std::uint64_t newest, int count) {
    std::vector<KeyFrameId> wanted;
    for (std::uint64_t id = newest; id > 0 && std::ssize(wanted) < count; --id)
      wanted.push_back(wire::keyframe_id(id));
    MapDelta delta = staging.active()->read(
        [&](const MapView& view) { return extract_keyframes(view, wanted); });
    const SE3 T_new_old = small_motion(random_, 0.5);
    std::set<MapPointId> gone;
    for (NewPoint& point : delta.points) {
      point.p_w = T_new_old * point.p_w;
      if (random_() % 8 == 0) gone.insert(point.id);
    }
    for (NewKeyFrame& keyframe : delta.keyframes) {
      keyframe.T_cw = (keyframe.T_cw * T_new_old.inverse()).normalized();
      for (MapPointId& id : keyframe.points) {
        if (!gone.contains(id)) continue;
        id = id.value % 2 ? MapPointId{} : survivor_of(id);
      }
    }
    std::set<MapPointId> seen;
    for (const NewKeyFrame& keyframe : delta.keyframes)
      seen.insert(keyframe.points.begin(), keyframe.points.end());
    std::vector<NewPoint> survivors;
    for (const NewPoint& point : delta.points) {
      if (!gone.contains(point.id)) continue;
      NewPoint survivor = point;
      survivor.id = survivor_of(point.id);
      if (seen.contains(survivor.id)) survivors.push_back(survivor);
    }
    std::erase_if(delta.points, [&](const NewPoint& p) { return gone.contains(p.id); });
    delta.points.insert(delta.points.end(), survivors.begin(), survivors.end());
    return delta;
  }

  static MapPointId survivor_of(MapPointId id) {
    return wire::point_id(id.value & 0xffffff, IdSpace::kEdgeMapper);
  }

  void swap() {
    staging.drain();
    staging.swap();
    staging.clean();
    staging.release();
  }

 private:
  std::mt19937 random_;
  std::shared_ptr<const FeatureSet> features_;
  std::vector<MapPointId> before_;
  std::uint64_t points_ = 0;

 public:
  MapStaging staging;
  std::uint64_t made = 0;
  SE3 T_cw;
};

}  // namespace slambed::testing
