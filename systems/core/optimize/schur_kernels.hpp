// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace slambed {

/// Doubles from one column of a block with six rows to the next: whole vectors fit.
inline constexpr int kColumnStride = 8;
inline constexpr int kCrossSize = 3 * kColumnStride;  ///< pose-point block, 6 x 3
inline constexpr int kPoseBlockSize = 6 * kColumnStride;
/// Of a pose: lower triangle of its block of the normal equations column by column (21), gradient.
inline constexpr int kPoseSumsSize = 32, kPoseGradient = 21;
/// Of a point: its block xx xy xz yy yz zz, gradient.
inline constexpr int kPointSumsSize = 16, kPointGradient = 6;
/// A pose as kernels read it: rotation column by column, translation.
inline constexpr int kPoseSize = 12;
inline constexpr int kPointSize = 4;  ///< x y z and room
/// Columns that a factorization takes at a time.
inline constexpr int kFactorColumns = 4;
/// Arrays of rows have room for this many beyond the last.
inline constexpr std::size_t kRowSlack = 8;

/// Everything that the error of an observation hangs on.
struct RowsView {
  const double *u, *v, *right_u, *weight, *right_weight, *chi2_limit;
  const std::uint32_t *pose, *point;
  const double* poses;   ///< kPoseSize each
  const double* points;  ///< kPointSize each
  double fx, fy, cx, cy, bf;
  double least_depth_m;
  bool robust;  ///< Huber's loss
};

/// Where linearize() adds up. Rows on free poses have a slot: a place among the rows of their pose.
struct NormalSums {
  const std::uint8_t* active;
  const std::uint32_t* slot;  ///< per row; unused where the pose is fixed
  std::uint32_t free_poses;
  double* pose_sums;      ///< kPoseSumsSize per free pose, zero at first
  double* point_sums;     ///< kPointSumsSize per point, zero at first
  double* cross;          ///< kCrossSize per slot
  std::uint8_t* coupled;  ///< per slot: cross is filled
};

/// Two slots of one point: the first of the pose at hand, the second of it or a later one.
struct SlotPair {
  std::uint32_t first, second;
};

/// The points seen by one pose are taken out of its column of the system: block by block, so that a
/// block stays in registers while all its points pass, in their order.
struct ColumnElimination {
  std::size_t first_slot, rows;  ///< of the pose
  const double* cross;           ///< kCrossSize per slot
  const std::uint8_t* coupled;   ///< per slot: takes part ...
  const std::uint32_t* point;    ///< per slot
  const double* inverse;  ///< of each point's damped block: xx xy xz yy yz zz, inverse * gradient
  const std::uint8_t* invertible;  ///< ... where its point has one
  double* right;                   ///< kColumnStride
  double* scratch;                 ///< kCrossSize per row of the pose
  std::uint8_t* taking_part;       ///< per row of the pose, scratch
  double* blocks;                  ///< kPoseBlockSize each, the one on the diagonal first
  std::size_t block_count;
  const std::size_t* pair_begin;  ///< per block, and the end
  const SlotPair* pairs;
};

/// Inner loops of the bundle solver. All implementations compute the same bytes: every number is
/// made by the same operations in the same order, only more of them at a time. Their files use
/// nothing inline from elsewhere, as features/kernels.hpp says.
struct SchurKernels {
  const char* name;
  /// Normal equations of rows [0, rows).
  void (*linearize)(const RowsView& view, std::size_t rows, const NormalSums& sums);
  /// Cost of each row; behind marks those not in front of the camera, whose cost is not computed.
  void (*row_costs)(const RowsView& view, std::size_t rows, double* cost, std::uint8_t* behind);
  /// blocks -= W V^-1 W', right -= W V^-1 g.
  void (*eliminate)(const ColumnElimination& column);
  /// The lower triangle of a symmetric matrix becomes its Cholesky factor in place; what is above
  /// it is lost. size: a multiple of kFactorColumns; stride: from one column to the next, a
  /// multiple of kColumnStride; scratch: kFactorColumns per column. False when it is not positive
  /// definite.
  bool (*factorize)(double* matrix, std::size_t size, std::size_t stride, double* scratch);
};

const SchurKernels& portable_schur_kernels();
/// Null in builds for other processors.
const SchurKernels* avx2_schur_kernels();
const SchurKernels* avx512_schur_kernels();
/// The fastest that this processor can run.
const SchurKernels& fastest_schur_kernels();

}  // namespace slambed
