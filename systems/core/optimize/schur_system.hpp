// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/se3.hpp"
#include "optimize/damping.hpp"
#include "optimize/reprojection.hpp"

namespace slambed {

template <int D>
class SparseBlocks;

/// One observation of a bundle, sorted by point and then by pose.
struct BundleRow {
  Measurement measurement;
  std::uint32_t pose = 0;
  std::uint32_t original = 0;  ///< place in the caller's list
  bool active = true;
};

/// The observations of all points: those of point i are rows [begin[i], begin[i + 1]).
struct BundleRows {
  std::vector<BundleRow> rows;
  std::vector<std::uint32_t> begin;
  int free_poses = 0;  ///< poses below this index move
};

/// Normal equations of a bundle at one set of values, solved by eliminating the points. Poses move
/// by the left perturbation (rho, phi) in their camera frame, points by a vector in the world
/// frame. The reduced camera system is dense for a local window and sparse for a whole map.
class SchurSystem {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  explicit SchurSystem(const BundleRows& bundle);
  ~SchurSystem();

  /// Fills the equations; the cost is that of the active rows.
  void linearise(const Pinhole& camera, const std::vector<SE3>& T_cw,
                 const std::vector<Eigen::Vector3d>& p_w, bool robust);

  /// Solves for the steps. False when the equations have no finite solution at this damping.
  bool solve(const Damping& damping);

  const std::vector<Vector6>& pose_steps() const { return pose_steps_; }
  const std::vector<Eigen::Vector3d>& point_steps() const { return point_steps_; }
  /// Fall of the cost that the linear model promises for the steps.
  double promised() const { return promised_; }

 private:
  using Block66 = std::array<double, 36>;  ///< column by column
  using Block63 = std::array<double, 18>;  ///< column by column
  struct PoseSums {
    std::array<double, 21> H{};  ///< lower triangle, column by column
    std::array<double, 6> g{};
  };
  struct PointSums {
    std::array<double, 6> H{};  ///< xx xy xz yy yz zz
    std::array<double, 3> g{};
  };

  /// Block of the reduced camera system, row >= column, column by column.
  double* reduced(std::size_t row, std::size_t column);
  void reset_reduced(const Damping& damping);
  void eliminate(std::size_t point, const Damping& damping);
  bool solve_poses();
  void back_substitute(std::size_t point);

  const BundleRows& bundle_;
  std::size_t poses_;
  std::vector<PoseSums> pose_sums_;
  std::vector<PointSums> point_sums_;
  std::vector<PointSums> point_inverse_;     ///< damped inverse, and inverse * g
  std::vector<Block63> cross_;               ///< pose-point block of each row on a free pose
  std::vector<std::uint8_t> coupled_;        ///< the row is active and on a free pose
  std::vector<Block66> reduced_;             ///< lower block triangle of the reduced camera system
  std::unique_ptr<SparseBlocks<6>> sparse_;  ///< instead of it, for many poses
  Eigen::MatrixXd dense_;
  Eigen::VectorXd right_;
  std::vector<Vector6> pose_steps_;
  std::vector<Eigen::Vector3d> point_steps_;
  double promised_ = 0;
};

/// Cost of the active rows; with all = true of every row, active or not.
double bundle_cost(const BundleRows& bundle, const Pinhole& camera, const std::vector<SE3>& T_cw,
                   const std::vector<Eigen::Vector3d>& p_w, bool robust, bool all = false);

/// Cost of the active rows at a trial. A point that its step carries behind a camera returns to its
/// fallback where that is cheaper: the fall of a whole bundle would otherwise pay for its loss, and
/// from behind the cameras no derivative leads back.
double trial_cost(const BundleRows& bundle, const Pinhole& camera, const std::vector<SE3>& T_cw,
                  const std::vector<Eigen::Vector3d>& fallback, std::vector<Eigen::Vector3d>& p_w,
                  bool robust);

}  // namespace slambed
