// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/se3.hpp"
#include "optimize/aligned_doubles.hpp"
#include "optimize/bundle_rows.hpp"
#include "optimize/schur_kernels.hpp"

namespace slambed {

/// The poses and points of a bundle in the layout that kernels read.
class BundleValues {
 public:
  BundleValues(const BundleRows& bundle, const Pinhole& camera)
      : bundle_(bundle), camera_(camera) {}

  /// Sets the values to read. The poses must outlive their use; the points are copied.
  void look_at(std::span<const SE3> T_cw, std::span<const Eigen::Vector3d> p_w);
  RowsView view(bool robust) const;

 private:
  const BundleRows& bundle_;
  Pinhole camera_;
  const double* poses_ = nullptr;
  AlignedDoubles points_;
};

/// Computes costs of a bundle. Keeps its scratch memory.
class BundleCost {
 public:
  BundleCost(const BundleRows& bundle, const Pinhole& camera, const SchurKernels& kernels);

  /// Cost of the active rows, or of all rows if `all` is true.
  double of(const BundleValues& values, bool robust, bool all = false);

  /// Cost of the active rows at a trial step. A point that moved behind a camera is reset to its
  /// fallback if that costs less. Otherwise a decrease of the total cost could outweigh the lost
  /// point, and no derivative moves a point back in front of the cameras.
  double of_trial(const std::vector<SE3>& T_cw, const std::vector<Eigen::Vector3d>& fallback,
                  std::vector<Eigen::Vector3d>& p_w, bool robust);

 private:
  struct PointCost {
    double cost = 0;
    bool behind = false;  ///< of at least one camera
  };
  void compute_rows(const BundleValues& values, bool robust);
  /// Sums the rows of a point after compute_rows().
  PointCost sum(std::size_t point, bool all) const;
  double kept_cost(std::size_t point, const std::vector<SE3>& T_cw, const Eigen::Vector3d& p_w,
                   bool robust) const;

  const BundleRows& bundle_;
  Pinhole camera_;
  const SchurKernels& kernels_;
  BundleValues trial_;
  std::vector<double> row_cost_;
  std::vector<std::uint8_t> behind_;
};

}  // namespace slambed
