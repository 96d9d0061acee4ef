// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "features/corner_detector.hpp"
#include "features/orb_extractor.hpp"

namespace slambed {

/// Reduces the corners of a level to a quota, spread over the image. Raster order breaks ties
/// between equal responses, so the same corners always give the same selection.
class CornerSelector {
 public:
  explicit CornerSelector(Distribution distribution) : distribution_(distribution) {}

  /// Reserves memory, so that select() does not allocate up to these numbers.
  void reserve(std::size_t most_corners, int largest_quota);

  /// Keeps at most quota corners (quadtree: quota + 3) in place, in raster order.
  void select(const DetectionRegion& region, int quota, std::vector<Corner>& corners);

 private:
  void select_by_grid(const DetectionRegion& region, int quota, std::vector<Corner>& corners);
  void select_by_quadtree(const DetectionRegion& region, int quota, std::vector<Corner>& corners);

  struct Node {
    int x0, y0, x1, y1;        ///< half open
    std::uint32_t begin, end;  ///< its corners in order_
    std::uint32_t count() const { return end - begin; }
  };
  void split(const std::vector<Corner>& corners, Node node);

  Distribution distribution_;
  std::vector<std::uint32_t> order_, scratch_;
  std::vector<std::uint64_t> keys_, best_, taken_;  ///< best_ and taken_: per grid cell
  std::vector<std::uint8_t> chosen_;                ///< per corner
  std::vector<std::uint16_t> column_of_x_;
  std::vector<Node> nodes_, expandable_, final_;
};

}  // namespace slambed
