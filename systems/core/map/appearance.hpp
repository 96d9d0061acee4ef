// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "features/feature_set.hpp"
#include "map/elements.hpp"

namespace slambed {

/// Finds the descriptor with the least median distance to the others, as ORB-SLAM2 does for a map
/// point. Keeps its scratch memory; one instance per thread.
class DescriptorChooser {
 public:
  /// Returns an index into candidates, which must not be empty; the first one of equals.
  int choose(std::span<const Descriptor* const> candidates);

 private:
  std::vector<std::uint16_t> row_;  ///< distances of one candidate to all
};

struct DistanceRange {
  float min_m = 0, max_m = 0;
};

/// Returns the distances at which a point seen at this octave from distance_m can be detected.
DistanceRange distance_range(double distance_m, int octave, const ScalePyramid& pyramid);

/// Returns the appearance of a point with one observation: feature number `feature`, camera T_cw.
Appearance appearance_of(const Eigen::Vector3d& p_w, const SE3& T_cw, const FeatureSet& features,
                         int feature);

/// Predicts the octave of a point: ceil(log(max / d) / log s), clamped to the pyramid.
int predict_octave(float max_distance_m, float distance_m, const ScalePyramid& pyramid);

}  // namespace slambed
