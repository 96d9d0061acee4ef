// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed {

/// A map point and its matched pixel.
struct PnpCorrespondence {
  Eigen::Vector3d p_w;
  double u = 0, v = 0;
  double sigma2 = 1;  ///< variance of the pixel, px^2
};

struct PnpOptions {
  int max_iterations = 300;
  int min_inliers = 10;
  double confidence = 0.99;
  double chi2_limit = 5.991;  ///< inlier threshold: two degrees of freedom, 5 %
  std::uint64_t seed = 1;
};

struct PnpResult {
  SE3 T_cw;
  std::vector<std::uint8_t> inlier;  ///< per correspondence
  int inliers = 0;
};

/// Estimates a camera pose from 2D-3D matches with outliers (P3P in RANSAC). The fourth match of
/// each sample selects among the P3P solutions. The pose comes from a minimal sample, so the caller
/// should refine it. Returns nothing when no sample reaches min_inliers.
std::optional<PnpResult> solve_pnp_ransac(const Camera& camera,
                                          std::span<const PnpCorrespondence> matches,
                                          const PnpOptions& options = {});

}  // namespace slambed
