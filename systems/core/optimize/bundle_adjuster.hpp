// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed {

struct BundleObservation {
  std::uint32_t pose = 0, point = 0;  ///< indices into the problem
  float u = 0, v = 0, right_u = -1;   ///< right_u < 0: monocular
  float inv_sigma2 = 1;
};

/// Initial values on input, optimized values on output. The first free_poses poses move, the rest
/// are fixed.
struct BundleProblem {
  Camera camera;
  std::vector<SE3> T_cw;
  int free_poses = 0;
  std::vector<Eigen::Vector3d> p_w;
  std::vector<BundleObservation> observations;
};

struct BundleOptions {
  int robust_iterations = 5;  ///< with Huber loss
  int final_iterations = 10;  ///< plain least squares without outliers
  /// A stage ends when the cost falls by less than this share. 0: only when it cannot fall further.
  double relative_stop = 1e-3;
};

/// Bundle adjustment by a hand-written Schur-complement Levenberg-Marquardt. step() runs one
/// iteration, so a caller can stop between steps and a virtual run can charge compute time for each
/// one. problem() always holds the best values so far.
class BundleAdjuster {
 public:
  explicit BundleAdjuster(BundleProblem problem, BundleOptions options = {});
  ~BundleAdjuster();
  BundleAdjuster(BundleAdjuster&&) noexcept;

  /// Runs one iteration and returns true, or returns false when both stages are finished.
  bool step();
  /// Classifies observations at the current values. 1 marks chi2 above the limit, a point behind
  /// the camera, or unusable input (a number that is not finite, an index out of range).
  std::vector<std::uint8_t> outliers() const;
  /// Huber cost of all usable observations, including outliers, at the current values.
  double robust_cost() const;
  /// Returns whether the robust stage has ended. Only then does a large error mean an outlier.
  bool robust_stage_done() const;
  const BundleProblem& problem() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
