// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed {

/// Chi-square limits at 5 % for two and three degrees of freedom (ORB-SLAM2).
inline constexpr double kChi2Mono = 5.991;
inline constexpr double kChi2Stereo = 7.815;

/// One map point seen in the frame; right_u < 0 marks a monocular observation.
struct PoseObservation {
  Eigen::Vector3d p_w;
  float u = 0, v = 0, right_u = -1;
  float inv_sigma2 = 1;
};

struct PoseOptions {
  int rounds = 4;       ///< each restarts from the input pose and reclassifies outliers
  int iterations = 10;  ///< Levenberg-Marquardt steps per round
  /// A round ends when the cost falls by less than this share. 0: only when it cannot fall further.
  double relative_stop = 1e-4;
};

struct PoseResult {
  SE3 T_cw;
  int inliers = 0;
  double cost = 0;  ///< sum of weighted squared errors over the inliers
};

/// Motion-only bundle adjustment as in ORB-SLAM2: rounds with Huber loss, the last one with plain
/// least squares. Hand-written 6x6 Levenberg-Marquardt; tests compare it with Ceres.
class PoseOptimizer {
 public:
  explicit PoseOptimizer(PoseOptions options = {}) : options_(options) {}

  /// Returns the initial pose with no inliers for fewer than three usable observations; runs only
  /// one round for fewer than ten. An observation with a number that is not finite is an outlier.
  /// outlier gets one flag per observation; 1 marks an outlier.
  PoseResult solve(const Camera& camera, const SE3& initial_T_cw,
                   std::span<const PoseObservation> observations,
                   std::vector<std::uint8_t>& outlier);

 private:
  PoseOptions options_;
};

}  // namespace slambed
