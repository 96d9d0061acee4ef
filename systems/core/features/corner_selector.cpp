// SPDX-License-Identifier: Apache-2.0
#include "features/corner_selector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

namespace slambed {

void CornerSelector::select(const DetectionRegion& region, int quota,
                            std::vector<Corner>& corners) {
  if (quota <= 0) corners.clear();
  if (static_cast<int>(corners.size()) <= quota) return;
  if (distribution_ == Distribution::kGrid)
    select_by_grid(region, quota, corners);
  else
    select_by_quadtree(region, quota, corners);
}

void CornerSelector::reserve(std::size_t most_corners, int largest_quota) {
  for (auto* list : {&order_, &scratch_, &cell_begin_}) list->reserve(most_corners + 1);
  keys_.reserve(most_corners);
  for (auto* list : {&nodes_, &expandable_, &final_}) list->reserve(largest_quota + 4);
}

/// About as many cells as the quota; first the best corner of every cell, then the second best, and
/// so on. Where a round has more than are still wanted, its strongest go first.
void CornerSelector::select_by_grid(const DetectionRegion& region, int quota,
                                    std::vector<Corner>& corners) {
  const double side = std::sqrt(static_cast<double>(region.width()) * region.height() / quota);
  const int columns = std::max(1, static_cast<int>(std::lround(region.width() / side)));
  const int rows = std::max(1, static_cast<int>(std::lround(region.height() / side)));
  const auto cell = [&](const Corner& c) {
    return (c.y - region.y0) * rows / region.height() * columns +
           (c.x - region.x0) * columns / region.width();
  };
  // Counting sort by cell; within a cell the corners stay in raster order.
  cell_begin_.assign(static_cast<std::size_t>(columns) * rows + 1, 0);
  for (const Corner& c : corners) ++cell_begin_[cell(c) + 1];
  for (std::size_t i = 1; i < cell_begin_.size(); ++i) cell_begin_[i] += cell_begin_[i - 1];
  order_.resize(corners.size());
  scratch_.assign(cell_begin_.begin(), cell_begin_.end() - 1);
  for (std::uint32_t i = 0; i < corners.size(); ++i) order_[scratch_[cell(corners[i])]++] = i;

  keys_.clear();  // rank in the cell, then response downwards, then raster order
  for (std::size_t k = 0; k + 1 < cell_begin_.size(); ++k) {
    const auto begin = order_.begin() + cell_begin_[k], end = order_.begin() + cell_begin_[k + 1];
    std::sort(begin, end, [&](std::uint32_t a, std::uint32_t b) {
      return std::tuple(corners[b].response, a) < std::tuple(corners[a].response, b);
    });
    for (auto it = begin; it != end; ++it) {
      const std::uint64_t rank = it - begin;
      keys_.push_back(rank << 40 | std::uint64_t{255u - corners[*it].response} << 32 | *it);
    }
  }
  std::nth_element(keys_.begin(), keys_.begin() + quota, keys_.end());
  order_.clear();
  for (int i = 0; i < quota; ++i) order_.push_back(static_cast<std::uint32_t>(keys_[i]));
  std::sort(order_.begin(), order_.end());
  for (int i = 0; i < quota; ++i) corners[i] = corners[order_[i]];
  corners.resize(quota);
}

/// Replaces a node by its up to four non-empty quarters (half sizes rounded up), which go to final_
/// when they hold one corner and to nodes_ when they hold more.
void CornerSelector::split(const std::vector<Corner>& corners, Node node) {
  const int mid_x = node.x0 + (node.x1 - node.x0 + 1) / 2;
  const int mid_y = node.y0 + (node.y1 - node.y0 + 1) / 2;
  const auto quarter = [&](std::uint32_t i) {
    return (corners[i].y >= mid_y ? 2 : 0) + (corners[i].x >= mid_x ? 1 : 0);
  };
  std::array<std::uint32_t, 5> begin{};
  for (std::uint32_t i = node.begin; i < node.end; ++i) ++begin[quarter(order_[i]) + 1];
  begin[0] = node.begin;
  for (int q = 0; q < 4; ++q) begin[q + 1] += begin[q];
  std::copy(order_.begin() + node.begin, order_.begin() + node.end, scratch_.begin());
  auto next = begin;
  for (std::uint32_t i = 0; i < node.count(); ++i)
    order_[next[quarter(scratch_[i])]++] = scratch_[i];
  for (int q = 0; q < 4; ++q) {
    const Node child{q & 1 ? mid_x : node.x0,
                     q & 2 ? mid_y : node.y0,
                     q & 1 ? node.x1 : mid_x,
                     q & 2 ? node.y1 : mid_y,
                     begin[q],
                     begin[q + 1]};
    if (child.count() > 1)
      nodes_.push_back(child);
    else if (child.count() == 1)
      final_.push_back(child);
  }
}

/// ORB-SLAM2's rule: split every node that holds more than one corner into four until there are as
/// many nodes as wanted; when the next full round would overshoot, split the fullest first.
void CornerSelector::select_by_quadtree(const DetectionRegion& region, int quota,
                                        std::vector<Corner>& corners) {
  order_.resize(corners.size());
  scratch_.resize(corners.size());
  nodes_.clear();
  final_.clear();
  const long squares = std::lround(static_cast<double>(region.width()) / region.height());
  const int roots = static_cast<int>(std::clamp<long>(squares, 1, quota));
  const auto root_of = [&](const Corner& c) { return (c.x - region.x0) * roots / region.width(); };
  std::uint32_t filled = 0;
  for (int r = 0; r < roots; ++r) {
    const std::uint32_t begin = filled;
    for (std::uint32_t i = 0; i < corners.size(); ++i)
      if (root_of(corners[i]) == r) order_[filled++] = i;
    const Node root{region.x0 + (r * region.width() + roots - 1) / roots,
                    region.y0,
                    region.x0 + ((r + 1) * region.width() + roots - 1) / roots,
                    region.y1,
                    begin,
                    filled};
    if (root.count() > 1)
      nodes_.push_back(root);
    else if (root.count() == 1)
      final_.push_back(root);
  }

  const auto size = [&] { return static_cast<int>(nodes_.size() + final_.size()); };
  while (!nodes_.empty() && size() < quota) {
    expandable_.swap(nodes_);
    nodes_.clear();
    const int open = static_cast<int>(expandable_.size());
    const int reached = open + static_cast<int>(final_.size());
    if (reached + 3 * open > quota)
      std::sort(expandable_.begin(), expandable_.end(), [](const Node& a, const Node& b) {
        return std::tuple(b.count(), a.y0, a.x0) < std::tuple(a.count(), b.y0, b.x0);
      });
    int left = open;
    for (const Node& node : expandable_) {
      if (reached + 3 * open > quota && size() + left >= quota) {
        final_.push_back(node);
      } else {
        split(corners, node);
      }
      --left;
    }
  }
  final_.insert(final_.end(), nodes_.begin(), nodes_.end());

  keys_.clear();
  for (const Node& node : final_)
    keys_.push_back(*std::min_element(order_.begin() + node.begin, order_.begin() + node.end,
                                      [&](std::uint32_t a, std::uint32_t b) {
                                        return std::tuple(corners[b].response, a) <
                                               std::tuple(corners[a].response, b);
                                      }));
  std::sort(keys_.begin(), keys_.end());
  for (std::size_t i = 0; i < keys_.size(); ++i) corners[i] = corners[keys_[i]];
  corners.resize(keys_.size());
}

}  // namespace slambed
