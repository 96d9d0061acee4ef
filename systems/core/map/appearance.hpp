// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "features/feature_set.hpp"
#include "map/elements.hpp"

namespace slambed {

/// Finds the descriptor with the least median distance to the others (ORB-SLAM2's choice of a
/// point's descriptor). Keeps its scratch memory; one instance per thread.
class DescriptorChooser {
 public:
  /// Index into candidates (not empty); the first of equals.
  int choose(std::span<const Descriptor* const> candidates);

 private:
  std::vector<std::uint16_t> row_;  ///< distances of one candidate to all
};

struct DistanceRange {
  float min_m = 0, max_m = 0;
};

/// Distances at which a point seen at this octave from distance_m can be detected at all.
DistanceRange distance_range(double distance_m, int octave, const ScalePyramid& pyramid);

/// Appearance of a point that has a single observation: feature number `feature`, camera at T_cw.
Appearance appearance_of(const Eigen::Vector3d& p_w, const SE3& T_cw, const FeatureSet& features,
                         int feature);

/// Octave at which a point should be detected from distance_m: ceil(log(max / d) / log s), clamped
/// to the pyramid.
int predict_octave(float max_distance_m, float distance_m, const ScalePyramid& pyramid);

}  // namespace slambed
