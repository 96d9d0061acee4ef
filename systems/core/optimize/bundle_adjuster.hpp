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

/// Values in, values out: the first free_poses poses move, the rest are fixed.
struct BundleProblem {
  Camera camera;
  std::vector<SE3> T_cw;
  int free_poses = 0;
  std::vector<Eigen::Vector3d> p_w;
  std::vector<BundleObservation> observations;
};

struct BundleOptions {
  int robust_iterations = 5;  ///< Huber stage
  int final_iterations = 10;  ///< plain stage without outliers
  /// A stage ends when the cost falls by less than this share; 0: only when it cannot fall any
  /// more.
  double relative_stop = 1e-3;
};

/// Local bundle adjustment by a hand-written Schur-complement Levenberg-Marquardt. It advances one
/// iteration per step(), so a caller can be interrupted between steps and a virtual engine can
/// charge each one. The problem always holds the best values so far.
class BundleAdjuster {
 public:
  explicit BundleAdjuster(BundleProblem problem, BundleOptions options = {});
  ~BundleAdjuster();
  BundleAdjuster(BundleAdjuster&&) noexcept;

  /// Runs one iteration and returns true; false, without any work, when both stages are finished.
  bool step();
  /// Classifies observations with the current values: 1 marks chi2 above the limit, negative depth
  /// or an unusable one (a number that is not finite, an index out of range).
  std::vector<std::uint8_t> outliers() const;
  /// Huber cost of all usable observations at the current values, outliers too.
  double robust_cost() const;
  /// True once the first stage has ended: what is far off now is an outlier, not just unfinished.
  bool robust_stage_done() const;
  const BundleProblem& problem() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
