// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "slam/frame_search.hpp"

namespace slambed {

/// Finds the pose of a frame in a local map without a prediction: compares every point with every
/// feature and solves P3P in RANSAC. A last resort, as the cost is points times features.
class WideSearch {
 public:
  /// True when the frame has a pose that enough matches agree on; replaces all matches.
  bool locate(std::span<const PointSketch> points, FrameSearch& search, Frame& frame);

 private:
  /// A map point and the feature that looks like it.
  struct Pair {
    int point, feature;
    Eigen::Vector3d p_c;  ///< the feature in the camera frame; z = -1 without a usable depth
  };
  void match(std::span<const PointSketch> points, const FeatureSet& features);
  bool agree(const std::vector<Pair>& pairs, std::span<const PointSketch> points,
             const FeatureSet& features, SE3& T_cw);

  std::vector<Pair> pairs_;
  std::vector<std::uint8_t> inlier_, best_inlier_;
  std::vector<std::uint16_t> distances_;
};

}  // namespace slambed
