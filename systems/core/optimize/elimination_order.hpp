// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "optimize/bundle_rows.hpp"
#include "optimize/schur_kernels.hpp"
#include "optimize/sparse_blocks.hpp"

namespace slambed {

/// The reduced camera system by columns; rows of a block beyond the sixth are padding.
using PoseBlocks = SparseBlocks<6, kColumnStride>;

/// Order of the rows with free poses (slots) for eliminating points pose by pose. The slots of a
/// pose are contiguous, and each block sums its points in order.
struct EliminationOrder {
  /// sparse: the nonzero blocks; null: all blocks of the lower triangle.
  EliminationOrder(const BundleRows& rows, const PoseBlocks* sparse);

  std::size_t slots() const { return point.size(); }
  std::size_t blocks() const { return block_begin.back(); }

  std::vector<std::uint32_t> slot;        ///< of each row, ordered by pose and then by point
  std::vector<std::uint32_t> slot_begin;  ///< of each pose, and the end
  std::vector<std::uint32_t> point;       ///< of each slot
  std::size_t most_rows = 0;              ///< largest number of rows of one pose
  std::vector<std::size_t> block_begin;   ///< of each column, and the end
  std::vector<std::size_t> pair_begin;    ///< of each block, and the end
  std::vector<SlotPair> pairs;

 private:
  void order_rows(const BundleRows& rows, std::size_t poses);
  void list_pairs(const BundleRows& rows, std::size_t poses, const PoseBlocks* sparse);
};

}  // namespace slambed
