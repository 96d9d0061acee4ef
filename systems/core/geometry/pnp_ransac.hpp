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

/// A map point and the pixel in which it is believed to be seen.
struct PnpCorrespondence {
  Eigen::Vector3d p_w;
  double u = 0, v = 0;
  double sigma2 = 1;  ///< variance of the pixel, px^2
};

struct PnpOptions {
  int max_iterations = 300;
  int min_inliers = 10;
  double confidence = 0.99;
  double chi2_limit = 5.991;  ///< two degrees of freedom, 5 %
  std::uint64_t seed = 1;
};

struct PnpResult {
  SE3 T_cw;
  std::vector<std::uint8_t> inlier;  ///< per correspondence
  int inliers = 0;
};

/// Pose of a camera from 2D-3D matches with outliers: three-point samples, the fourth point of each
/// sample chooses among the solutions. The result is a sample's pose, to be refined by the caller.
/// Nothing when no sample reaches min_inliers.
std::optional<PnpResult> solve_pnp_ransac(const Camera& camera,
                                          std::span<const PnpCorrespondence> matches,
                                          const PnpOptions& options = {});

}  // namespace slambed
