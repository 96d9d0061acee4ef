// SPDX-License-Identifier: Apache-2.0
#include "features/corner_detector.hpp"

#include <algorithm>
#include <cstring>

namespace slambed {

CornerDetector::CornerDetector(int threshold, int threshold_min, const Kernels& kernels)
    : threshold_(threshold), threshold_min_(threshold_min), kernels_(kernels) {}

void CornerDetector::detect(GreyView level, std::vector<Corner>& out) {
  out.clear();
  const DetectionRegion region(level);
  if (region.empty()) return;
  find_peaks(level, region, out);
  apply_cell_rule(region, out);
}

void CornerDetector::find_peaks(GreyView level, const DetectionRegion& region,
                                std::vector<Corner>& out) {
  // One more pixel on each side is scored, so that the suppression sees all eight neighbours.
  const int scored = region.width() + 2;
  const std::size_t row_bytes = scored + 2 * kKernelSlack;
  scores_.resize(3 * row_bytes);
  columns_.resize(region.width());
  const auto score_row = [&](int y) { return scores_.data() + (y % 3) * row_bytes + kKernelSlack; };
  for (int y = region.y0 - 1; y <= region.y1; ++y) {
    std::uint8_t* score = score_row(y);
    kernels_.fast_row(level.row(y) + region.x0 - 1, level.stride, scored,
                      static_cast<std::uint8_t>(threshold_min_), score);
    std::memset(score + scored, 0, kKernelSlack);
    const int centre = y - 1;
    if (centre < region.y0) continue;
    const int count = kernels_.peaks_row(score_row(centre - 1) + 1, score_row(centre) + 1,
                                         score + 1, region.width(), columns_.data());
    const std::uint8_t* above = score_row(centre - 1) + 1;
    const std::uint8_t* value = score_row(centre) + 1;
    const std::uint8_t* below = score + 1;
    for (int i = 0; i < count; ++i) {
      const int column = columns_[i];
      Corner corner;
      corner.x = static_cast<std::uint16_t>(region.x0 + column);
      corner.y = static_cast<std::uint16_t>(centre);
      corner.response = static_cast<std::uint8_t>(value[column] - 1);
      corner.left = value[column - 1];
      corner.right = value[column + 1];
      corner.above = above[column];
      corner.below = below[column];
      out.push_back(corner);
    }
  }
}

void CornerDetector::apply_cell_rule(const DetectionRegion& region, std::vector<Corner>& corners) {
  const auto cell_side = [](int length) {
    const int cells = std::max(1, length / kCell);
    return (length + cells - 1) / cells;
  };
  const int cell_w = cell_side(region.width()), cell_h = cell_side(region.height());
  cell_of_x_.resize(region.width());
  for (int x = 0; x < region.width(); ++x) cell_of_x_[x] = static_cast<std::uint16_t>(x / cell_w);
  const int columns = cell_of_x_.back() + 1;
  has_strong_.reserve(columns);

  std::size_t kept = 0, begin = 0;
  while (begin < corners.size()) {  // one row of cells at a time
    const int row_end = region.y0 + ((corners[begin].y - region.y0) / cell_h + 1) * cell_h;
    has_strong_.assign(columns, 0);
    std::size_t end = begin;
    for (; end < corners.size() && corners[end].y < row_end; ++end)
      has_strong_[cell_of_x_[corners[end].x - region.x0]] |= corners[end].response >= threshold_;
    for (; begin < end; ++begin) {
      const Corner corner = corners[begin];
      if (corner.response >= threshold_ || !has_strong_[cell_of_x_[corner.x - region.x0]])
        corners[kept++] = corner;
    }
  }
  corners.resize(kept);
}

}  // namespace slambed
