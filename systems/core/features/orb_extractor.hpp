// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "features/image.hpp"
#include "features/keypoint.hpp"

namespace slambed {

struct Kernels;
class ImagePyramid;

/// How the corners of a pyramid level are thinned out to its quota.
enum class Distribution {
  kGrid,      ///< best of each cell of a regular grid, then second best ...: more features survive
  kQuadtree,  ///< ORB-SLAM2's quadtree
};

/// ORB-SLAM2's extractor settings.
struct OrbOptions {
  int features = 1000;
  int levels = 8;
  float scale_factor = 1.2f;
  int fast_threshold = 20;     ///< first try per cell
  int fast_threshold_min = 7;  ///< used in a cell where the first found nothing
  Distribution distribution = Distribution::kGrid;
  bool subpixel =
      true;  ///< refine the place of a corner; ORB-SLAM2 keeps whole pixels of its level
};

/// Scale of each pyramid level and the variance (px^2) a detection there has.
struct ScalePyramid {
  explicit ScalePyramid(const OrbOptions& options = {});
  std::vector<float> scale, sigma2, inv_sigma2;
  float log_scale_factor = 0;
  int levels() const { return static_cast<int>(scale.size()); }
};

/// Detects and describes ORB features. Owns its scratch memory: after the first image no call
/// allocates. One instance per thread.
class OrbExtractor {
 public:
  explicit OrbExtractor(const OrbOptions& options);
  /// With chosen inner loops; the result does not depend on them.
  OrbExtractor(const OrbOptions& options, const Kernels& kernels);
  ~OrbExtractor();
  OrbExtractor(OrbExtractor&&) noexcept;

  /// Fills keypoints (level 0 first, raw pixels) and descriptors, replacing what they held.
  /// An image smaller than the smallest usable pyramid level yields no features.
  void extract(GrayView image, std::vector<RawKeyPoint>& keypoints,
               std::vector<Descriptor>& descriptors);

  const OrbOptions& options() const;
  /// Number of features wanted from each level.
  const std::vector<int>& quotas() const;
  /// The levels of the last image.
  const ImagePyramid& pyramid() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
