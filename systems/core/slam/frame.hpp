// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/ids.hpp"
#include "features/feature_set.hpp"
#include "geometry/se3.hpp"

namespace slambed {

/// One image being tracked: its features, the map points they were matched with, its pose.
struct Frame {
  std::uint64_t index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
  bool has_pose = false;
  SE3 T_cw;
  KeyFrameId reference;
  SE3 T_cr;                           ///< camera from reference keyframe
  std::vector<MapPointId> points;     ///< per feature; none where unmatched
  std::vector<Eigen::Vector3d> p_w;   ///< of the matched points
  std::vector<std::uint8_t> outlier;  ///< of the matched points, by the last pose optimization

  /// Starts a new image and clears everything else; keeps the allocated memory.
  void begin(std::uint64_t frame_index, double time_s, std::shared_ptr<const FeatureSet> set) {
    index = frame_index;
    timestamp_s = time_s;
    features = std::move(set);
    has_pose = false;
    T_cw = SE3();
    reference = {};
    T_cr = SE3();
    p_w.resize(features->size());
    clear_matches();
  }
  void clear_matches() {
    points.assign(features->size(), MapPointId{});
    outlier.assign(features->size(), 0);
  }
  void match(int feature, MapPointId id, const Eigen::Vector3d& position) {
    points[feature] = id;
    p_w[feature] = position;
    outlier[feature] = 0;
  }
  int matches() const {
    int count = 0;
    for (const MapPointId id : points) count += static_cast<bool>(id);
    return count;
  }
  /// Removes the matches that the pose optimization rejected.
  void drop_outliers() {
    for (std::size_t i = 0; i < points.size(); ++i)
      if (outlier[i]) {
        points[i] = {};
        outlier[i] = 0;
      }
  }
};

/// The data of a map point that a search needs, copied from the map.
struct PointSketch {
  MapPointId id;
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float min_distance_m = 0, max_distance_m = 0;
  Descriptor descriptor{};
};

}  // namespace slambed
