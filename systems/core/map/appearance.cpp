// SPDX-License-Identifier: Apache-2.0
#include "map/appearance.hpp"

#include <algorithm>

#include "features/descriptor_distance.hpp"

namespace slambed {

int DescriptorChooser::choose(std::span<const Descriptor* const> candidates) {
  const std::size_t n = candidates.size();
  // The median of one or two distances is the one to itself, so the first candidate wins.
  if (n <= 2) return 0;
  row_.resize(n);
  const DistanceKernels& distance = descriptor_distance();
  const std::size_t middle = (n - 1) / 2;
  int best = 0;
  int best_median = 257;
  for (std::size_t i = 0; i < n; ++i) {
    distance.to_each(*candidates[i], candidates, row_.data());
    // The median can only be better if more than `middle` distances are below the best one.
    std::uint16_t below = 0;
    for (const std::uint16_t d : row_)
      below = static_cast<std::uint16_t>(below + (d < best_median));
    if (below <= middle) continue;
    std::nth_element(row_.begin(), row_.begin() + static_cast<std::ptrdiff_t>(middle), row_.end());
    best_median = row_[middle];
    best = static_cast<int>(i);
  }
  return best;
}

DistanceRange distance_range(double distance_m, int octave, const ScalePyramid& pyramid) {
  const float max_m = static_cast<float>(distance_m) * pyramid.scale[octave];
  return {max_m / pyramid.scale.back(), max_m};
}

Appearance appearance_of(const Eigen::Vector3d& p_w, const SE3& T_cw, const FeatureSet& features,
                         int feature) {
  const Eigen::Vector3d ray = p_w - T_cw.inverse().t;
  const double distance_m = ray.norm();
  const DistanceRange range =
      distance_range(distance_m, features.keypoint(feature).octave, features.sensor().pyramid);
  Appearance appearance;
  appearance.descriptor = features.descriptor(feature);
  appearance.normal = (ray / distance_m).cast<float>();
  appearance.min_distance_m = range.min_m;
  appearance.max_distance_m = range.max_m;
  return appearance;
}

int predict_octave(float max_distance_m, float distance_m, const ScalePyramid& pyramid) {
  // The smallest octave whose scale reaches the ratio equals the ceiling of the logarithm.
  const float ratio = max_distance_m / distance_m;
  int octave = 0;
  while (octave + 1 < pyramid.levels() && pyramid.scale[octave] < ratio) ++octave;
  return octave;
}

}  // namespace slambed
