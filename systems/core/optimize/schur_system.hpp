// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/se3.hpp"
#include "optimize/aligned_doubles.hpp"
#include "optimize/bundle_cost.hpp"
#include "optimize/damping.hpp"
#include "optimize/dense_cholesky.hpp"
#include "optimize/elimination_order.hpp"

namespace slambed {

/// Normal equations of a bundle at one set of values, solved by eliminating the points. Poses move
/// by the left perturbation (rho, phi) in their camera frame, points by a vector in the world
/// frame. The reduced camera system is dense for a local window and sparse for a whole map.
class SchurSystem {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  SchurSystem(const BundleRows& bundle, const SchurKernels& kernels);
  ~SchurSystem();

  /// Builds the equations from the active rows.
  void linearize(const BundleValues& values, bool robust);

  /// Solves for the steps. Returns false when there is no finite solution at this damping.
  bool solve(const Damping& damping);

  const std::vector<Vector6>& pose_steps() const { return pose_steps_; }
  const std::vector<Eigen::Vector3d>& point_steps() const { return point_steps_; }
  /// Decrease of the cost that the linear model predicts for the steps.
  double promised() const { return promised_; }

 private:
  /// Returns the diagonal block, the first one of the pose's column of the reduced camera system.
  double* column(std::size_t pose);
  void reset_reduced(const Damping& damping);
  void invert(std::size_t point, const Damping& damping);
  void eliminate(std::size_t pose);
  bool solve_poses();
  void back_substitute(std::size_t point);

  // schur_kernels.hpp describes the layout of blocks and sums.
  const BundleRows& bundle_;
  const SchurKernels& kernels_;
  std::size_t poses_;
  std::unique_ptr<PoseBlocks> sparse_;  ///< reduced camera system for many poses, else null
  EliminationOrder order_;
  AlignedDoubles pose_sums_, point_sums_;
  AlignedDoubles point_inverse_;  ///< damped inverse and inverse * g
  std::vector<std::uint8_t> invertible_;
  AlignedDoubles cross_;               ///< pose-point block of each slot
  std::vector<std::uint8_t> coupled_;  ///< per slot: the row contributes
  AlignedDoubles scratch_;             ///< for the elimination of one pose
  std::vector<std::uint8_t> taking_part_;
  AlignedDoubles reduced_;  ///< reduced camera system, unless sparse
  DenseCholesky dense_;     ///< factorization of reduced_
  AlignedDoubles right_;
  Eigen::VectorXd solution_;
  std::vector<Vector6> pose_steps_;
  std::vector<Eigen::Vector3d> point_steps_;
  double promised_ = 0;
};

}  // namespace slambed
