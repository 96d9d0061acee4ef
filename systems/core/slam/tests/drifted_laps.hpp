// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>

#include "geometry/sim3.hpp"
#include "scene_vocabulary.hpp"
#include "slam/place_index.hpp"

namespace slambed::testing {

/// A camera circles in a room, and its map drifts: points from a lap ago are mapped as new ones.
/// Keyframes are added to the map one by one.
class DriftedLaps {
 public:
  struct Drift {
    double turn_rad = 0.002, move_m = 0.004;  ///< per keyframe
    double scale = 0;                         ///< logarithm per keyframe; 0: rigid
    bool mono = false;                        ///< no depth: loops must find the scale
  };
  static constexpr int kPerLap = 60;

  explicit DriftedLaps(const Drift& drift)
      : map(std::make_shared<Map>()), drift_(drift), scene_(9000) {
    sensor_ = scene_.sensor();
    if (drift.mono) {
      auto mono = std::make_shared<Sensor>(*sensor_);
      mono->camera.bf = 0;
      sensor_ = mono;
    }
    places = std::make_shared<PlaceIndex>(scene_vocabulary(scene_));
  }

  /// On a circle of 0.8 m, looking outwards.
  static SE3 path(int k) {
    const double a = 2 * M_PI * k / kPerLap;
    const Eigen::Matrix3d R = Eigen::AngleAxisd(a, Eigen::Vector3d::UnitY()).toRotationMatrix();
    return SE3(R, {0.8 * std::sin(a), 0.05 * std::sin(2 * a), 0.8 * std::cos(a)}).inverse();
  }
  /// The true pose in the map's world, which begins at the first camera.
  static SE3 truth(int k) { return path(k) * path(0).inverse(); }
  static KeyFrameId id(int k) { return {std::uint64_t{1} << 56 | static_cast<unsigned>(k + 1)}; }

  KeyFrameId add() {
    const int k = count_++;
    if (k > 0) {
      Vector7 step = Vector7::Zero();
      step.head<3>().setConstant(drift_.move_m / std::sqrt(3.0));
      step(4) = drift_.turn_rad;
      step(6) = drift_.scale;
      S_cw_ = sim3_exp(step) * to_sim3(path(k) * path(k - 1).inverse()) * S_cw_;
    }
    MapDelta delta;
    NewKeyFrame keyframe;
    keyframe.id = id(k);
    keyframe.frame_index = static_cast<std::uint64_t>(k);
    keyframe.timestamp_s = k;
    keyframe.T_cw = to_se3(S_cw_);
    keyframe.features = look(k);
    for (int i = 0; i < keyframe.features->size(); ++i) {
      Tracked& known = known_[scene_.seen()[i]];
      if (!known.point || known.last_seen < k - kMemory) {
        NewPoint point;
        point.id = {std::uint64_t{1} << 56 | ++points_};
        point.p_w = S_cw_.inverse() * (path(k) * scene_.point(scene_.seen()[i]));
        point.reference = point.first_keyframe = keyframe.id;
        delta.points.push_back(point);
        known.point = point.id;
      }
      known.last_seen = k;
      keyframe.points.push_back(known.point);
    }
    delta.keyframes.push_back(std::move(keyframe));
    map->commit(delta);
    return id(k);
  }

  int count() const { return count_; }
  /// Largest distance of a keyframe from the truth, m.
  double worst_error_m() const {
    double worst = 0;
    for (int k = 0; k < count_; ++k) worst = std::max(worst, error_m(k));
    return worst;
  }
  double error_m(int k) const {
    return map->read(
        [&](const MapView& view) { return center_error(view.keyframe(id(k))->T_cw, truth(k)); });
  }
  SE3 pose(int k) const {
    return map->read([&](const MapView& view) { return view.keyframe(id(k))->T_cw; });
  }

  std::shared_ptr<Map> map;
  std::shared_ptr<PlaceIndex> places;

 private:
  /// Keyframes after which a thing out of sight is forgotten.
  static constexpr int kMemory = 12;
  struct Tracked {
    MapPointId point;
    int last_seen = 0;
  };

  std::shared_ptr<const FeatureSet> look(int k) {
    auto features =
        scene_.look(path(k), {.pixel_noise = 0.3, .depth_noise = 0.005, .flipped_bits = 6});
    if (!drift_.mono) return features;
    std::vector<KeyPoint> keypoints(features->keypoints().begin(), features->keypoints().end());
    for (KeyPoint& p : keypoints) p.depth_m = p.right_u = -1;
    return std::make_shared<FeatureSet>(
        sensor_, std::move(keypoints),
        std::vector<Descriptor>(features->descriptors().begin(), features->descriptors().end()));
  }

  Drift drift_;
  SyntheticScene scene_;
  std::shared_ptr<const Sensor> sensor_;
  std::map<int, Tracked> known_;
  Sim3 S_cw_;
  int count_ = 0;
  std::uint64_t points_ = 0;
};

}  // namespace slambed::testing
