// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "features/image.hpp"
#include "features/keypoint.hpp"

namespace slambed {

struct Kernels;
class ImagePyramid;

/// How the corners of a pyramid level are reduced to its quota.
enum class Distribution {
  kGrid,      ///< best corner of each grid cell, then the second best ...; keeps more features
  kQuadtree,  ///< ORB-SLAM2's quadtree
};

/// ORB-SLAM2's extractor settings.
struct OrbOptions {
  int features = 1000;
  int levels = 8;
  float scale_factor = 1.2f;
  int fast_threshold = 20;     ///< tried first in each cell
  int fast_threshold_min = 7;  ///< used in cells where the first finds nothing
  Distribution distribution = Distribution::kGrid;
  bool subpixel = true;  ///< refine corner positions; ORB-SLAM2 keeps whole pixels of the level
};

/// Scale of each pyramid level and the variance (px^2) of a detection on it.
struct ScalePyramid {
  explicit ScalePyramid(const OrbOptions& options = {});
  std::vector<float> scale, sigma2, inv_sigma2;
  float log_scale_factor = 0;
  int levels() const { return static_cast<int>(scale.size()); }
};

/// Detects and describes ORB features. Owns its scratch memory: images of the same size as the one
/// before cause no allocations. One instance per thread.
class OrbExtractor {
 public:
  explicit OrbExtractor(const OrbOptions& options);
  /// Uses the given kernels; the result does not depend on them.
  OrbExtractor(const OrbOptions& options, const Kernels& kernels);
  ~OrbExtractor();
  OrbExtractor(OrbExtractor&&) noexcept;

  /// Replaces the contents of keypoints (level 0 first, raw pixels) and descriptors.
  /// An image with a side below ImagePyramid::kMinSide gives no features.
  void extract(GrayView image, std::vector<RawKeyPoint>& keypoints,
               std::vector<Descriptor>& descriptors);

  const OrbOptions& options() const;
  /// Target number of features of each level.
  const std::vector<int>& quotas() const;
  /// Pyramid of the last image.
  const ImagePyramid& pyramid() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
