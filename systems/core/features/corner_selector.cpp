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
  for (auto* list : {&order_, &scratch_}) list->reserve(most_corners);
  keys_.reserve(most_corners);
  chosen_.reserve(most_corners);
  for (auto* list : {&best_, &taken_}) list->reserve(most_corners + 1);
  column_of_x_.reserve(most_corners);  // there are never more columns than most_corners
  for (auto* list : {&nodes_, &expandable_, &final_}) list->reserve(largest_quota + 4);
}

/// Uses about as many cells as the quota. Takes the best corner of every cell, then the second
/// best, and so on; the last round takes its strongest. More rounds are only needed when few cells
/// hold corners, so rounds times corners stays below the number of pixels.
void CornerSelector::select_by_grid(const DetectionRegion& region, int quota,
                                    std::vector<Corner>& corners) {
  const double side = std::sqrt(static_cast<double>(region.width()) * region.height() / quota);
  const int columns = std::max(1, static_cast<int>(std::lround(region.width() / side)));
  const int rows = std::max(1, static_cast<int>(std::lround(region.height() / side)));
  column_of_x_.resize(region.width());
  for (int x = 0; x < region.width(); ++x)
    column_of_x_[x] = static_cast<std::uint16_t>(x * columns / region.width());
  order_.resize(corners.size());  // the cell of each corner
  for (std::size_t i = 0; i < corners.size();) {
    const int y = corners[i].y, first = (y - region.y0) * rows / region.height() * columns;
    for (; i < corners.size() && corners[i].y == y; ++i)
      order_[i] = first + column_of_x_[corners[i].x - region.x0];
  }

  constexpr std::uint64_t kNone = ~std::uint64_t{0};
  const auto cells = static_cast<std::size_t>(columns) * rows;
  taken_.assign(cells, 0);
  chosen_.assign(corners.size(), 0);
  for (std::size_t left = quota; left > 0;) {
    // Keys sort by descending response, then raster order. A round takes the smallest key left.
    best_.assign(cells, kNone);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const std::uint64_t key = std::uint64_t{256u - corners[i].response} << 32 | i;
      std::uint64_t& best = best_[order_[i]];
      if (key > taken_[order_[i]]) best = std::min(best, key);
    }
    keys_.clear();
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (best_[cell] == kNone) continue;
      taken_[cell] = best_[cell];
      keys_.push_back(best_[cell]);
    }
    if (keys_.size() > left) {
      std::nth_element(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(left),
                       keys_.end());
      keys_.resize(left);
    }
    for (const std::uint64_t key : keys_) chosen_[static_cast<std::uint32_t>(key)] = 1;
    left -= keys_.size();
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    corners[kept] = corners[i];
    kept += chosen_[i];
  }
  corners.resize(kept);
}

/// Splits a node into its non-empty quarters (half sizes rounded up). Quarters with one corner go
/// to final_, those with more to nodes_.
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

/// ORB-SLAM2's rule: split every node with more than one corner into four until there are as many
/// nodes as the quota. When the next full round would exceed it, split the fullest nodes first.
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
