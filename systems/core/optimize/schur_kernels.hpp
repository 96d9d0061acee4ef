// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace slambed {

/// Doubles per column of a block with six rows, padded so that whole vectors fit.
inline constexpr int kColumnStride = 8;
inline constexpr int kCrossSize = 3 * kColumnStride;  ///< pose-point block, 6 x 3
inline constexpr int kPoseBlockSize = 6 * kColumnStride;
/// Sums of a pose: the lower triangle of its normal block by columns (21), then the gradient.
inline constexpr int kPoseSumsSize = 32, kPoseGradient = 21;
/// Sums of a point: its block xx xy xz yy yz zz, then the gradient.
inline constexpr int kPointSumsSize = 16, kPointGradient = 6;
/// A pose as kernels read it: rotation by columns, then translation.
inline constexpr int kPoseSize = 12;
inline constexpr int kPointSize = 4;  ///< x y z and padding
/// Columns that the factorization processes at a time.
inline constexpr int kFactorColumns = 4;
/// Padding elements beyond the last row in arrays of rows.
inline constexpr std::size_t kRowSlack = 8;

/// All inputs of the error of an observation.
struct RowsView {
  const double *u, *v, *right_u, *weight, *right_weight, *chi2_limit;
  const std::uint32_t *pose, *point;
  const double* poses;   ///< kPoseSize each
  const double* points;  ///< kPointSize each
  double fx, fy, cx, cy, bf;
  double least_depth_m;
  bool robust;  ///< Huber's loss
};

/// Output of linearize(). A row with a free pose has a slot (EliminationOrder).
struct NormalSums {
  const std::uint8_t* active;
  const std::uint32_t* slot;  ///< per row; unused for fixed poses
  std::uint32_t free_poses;
  double* pose_sums;      ///< kPoseSumsSize per free pose, initially zero
  double* point_sums;     ///< kPointSumsSize per point, initially zero
  double* cross;          ///< kCrossSize per slot
  std::uint8_t* coupled;  ///< per slot: whether cross is filled
};

/// Two slots of one point: the first of the column's pose, the second of that pose or a later one.
struct SlotPair {
  std::uint32_t first, second;
};

/// Elimination of the points seen by one pose from its column of the system, block by block, so
/// that a block stays in registers while its points are added in order.
struct ColumnElimination {
  std::size_t first_slot, rows;    ///< of the pose
  const double* cross;             ///< kCrossSize per slot
  const std::uint8_t* coupled;     ///< per slot: its row contributes
  const std::uint32_t* point;      ///< per slot
  const double* inverse;           ///< per point: inverse of its damped block, inverse * gradient
  const std::uint8_t* invertible;  ///< per point; others are not eliminated
  double* right;                   ///< kColumnStride
  double* scratch;                 ///< kCrossSize per row of the pose
  std::uint8_t* taking_part;       ///< per row of the pose, scratch
  double* blocks;                  ///< kPoseBlockSize each, diagonal block first
  std::size_t block_count;
  const std::size_t* pair_begin;  ///< per block, and the end
  const SlotPair* pairs;
};

/// Inner loops of the bundle solver. All implementations compute the same bytes, because every
/// number results from the same operations in the same order. Their files use no inline functions
/// from other headers (see features/kernels.hpp).
struct SchurKernels {
  const char* name;
  /// Normal equations of rows [0, rows).
  void (*linearize)(const RowsView& view, std::size_t rows, const NormalSums& sums);
  /// Cost of each row; behind marks rows not in front of the camera, whose cost is invalid.
  void (*row_costs)(const RowsView& view, std::size_t rows, double* cost, std::uint8_t* behind);
  /// blocks -= W V^-1 W', right -= W V^-1 g.
  void (*eliminate)(const ColumnElimination& column);
  /// Replaces the lower triangle of a symmetric matrix by its Cholesky factor and overwrites the
  /// upper one. size: a multiple of kFactorColumns; stride between columns: a multiple of
  /// kColumnStride; scratch: kFactorColumns per column. Returns false when the matrix is not
  /// positive definite.
  bool (*factorize)(double* matrix, std::size_t size, std::size_t stride, double* scratch);
};

const SchurKernels& portable_schur_kernels();
/// Null in builds for other architectures.
const SchurKernels* avx2_schur_kernels();
const SchurKernels* avx512_schur_kernels();
/// Returns the fastest kernels that this processor can run.
const SchurKernels& fastest_schur_kernels();

}  // namespace slambed
