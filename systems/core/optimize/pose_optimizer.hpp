// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed {

/// chi-square limits at 5 %: two and three degrees of freedom (ORB-SLAM2's).
inline constexpr double kChi2Mono = 5.991;
inline constexpr double kChi2Stereo = 7.815;

/// One map point seen in the frame; right_u < 0 marks a monocular observation.
struct PoseObservation {
  Eigen::Vector3d p_w;
  float u = 0, v = 0, right_u = -1;
  float inv_sigma2 = 1;
};

struct PoseOptions {
  int rounds = 4;       ///< each restarts from the input pose and re-classifies outliers
  int iterations = 10;  ///< Levenberg-Marquardt steps per round
  double relative_stop =
      1e-4;  ///< a round ends when the cost falls by less; 0: when it cannot fall
};

struct PoseResult {
  SE3 T_cw;
  int inliers = 0;
  double cost = 0;  ///< sum of weighted squared errors over the inliers
};

/// Motion-only bundle adjustment (ORB-SLAM2's rounds of Huber, then plain least squares).
/// Hand-written 6x6 Levenberg-Marquardt; Ceres is the oracle in the tests.
class PoseOptimizer {
 public:
  explicit PoseOptimizer(PoseOptions options = {}) : options_(options) {}

  /// Fewer than three usable observations: returns the initial pose with no inliers. Observations
  /// with a number that is not finite are outliers; fewer than ten usable ones get a single round.
  /// outlier is resized to the observations; 1 marks an outlier.
  PoseResult solve(const Camera& camera, const SE3& initial_T_cw,
                   std::span<const PoseObservation> observations,
                   std::vector<std::uint8_t>& outlier);

 private:
  PoseOptions options_;
};

}  // namespace slambed
