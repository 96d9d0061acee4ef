// SPDX-License-Identifier: Apache-2.0
#include "optimize/elimination_order.hpp"

#include <algorithm>

namespace slambed {

EliminationOrder::EliminationOrder(const BundleRows& rows, const PoseBlocks* sparse) {
  const auto poses = static_cast<std::size_t>(rows.free_poses);
  order_rows(rows, poses);
  block_begin.push_back(0);
  for (std::size_t p = 0; p < poses; ++p)
    block_begin.push_back(sparse ? sparse->column_end(p) : block_begin.back() + poses - p);
  list_pairs(rows, poses, sparse);
}

void EliminationOrder::order_rows(const BundleRows& rows, std::size_t poses) {
  slot_begin.assign(poses + 1, 0);
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (rows.pose[k] < poses) ++slot_begin[rows.pose[k] + 1];
  for (std::size_t p = 0; p < poses; ++p) {
    most_rows = std::max<std::size_t>(most_rows, slot_begin[p + 1]);
    slot_begin[p + 1] += slot_begin[p];
  }
  slot.resize(rows.size());
  point.resize(slot_begin.back());
  std::vector<std::uint32_t> next(slot_begin);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows.pose[k] >= poses) continue;
    slot[k] = next[rows.pose[k]]++;
    point[slot[k]] = rows.point[k];
  }
}

void EliminationOrder::list_pairs(const BundleRows& rows, std::size_t poses,
                                  const PoseBlocks* sparse) {
  const auto for_each_pair = [&](auto&& visit) {
    for (std::size_t i = 0; i + 1 < rows.begin.size(); ++i) {
      const std::size_t end = rows.begin[i + 1];
      for (std::size_t k = rows.begin[i]; k < end && rows.pose[k] < poses; ++k) {
        const std::uint32_t column = rows.pose[k];
        for (std::size_t l = k; l < end && rows.pose[l] < poses; ++l) {
          const std::uint32_t row = rows.pose[l];
          visit(sparse ? sparse->find(row, column) : block_begin[column] + row - column,
                SlotPair{slot[k], slot[l]});
        }
      }
    }
  };
  pair_begin.assign(blocks() + 1, 0);
  for_each_pair([&](std::size_t block, SlotPair) { ++pair_begin[block + 1]; });
  for (std::size_t b = 0; b < blocks(); ++b) pair_begin[b + 1] += pair_begin[b];
  pairs.resize(pair_begin.back());
  std::vector<std::size_t> next(pair_begin);
  for_each_pair([&](std::size_t block, SlotPair pair) { pairs[next[block]++] = pair; });
}

}  // namespace slambed
