// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include "slam/keyframe_copy.hpp"

namespace slambed {

/// Triangulates new points from unmatched features of a keyframe and its best covisibles. Searches
/// for correspondences along the epipolar line.
class PointTriangulation {
 public:
  /// The delta adds points and attaches them to both keyframes; empty when the keyframe is gone.
  MapDelta run(const Map& map, KeyFrameId keyframe, int neighbors, IdSource<MapPointId>& ids);

 private:
  /// Features of the neighbor without a point, as arrays for the line search.
  struct Loose {
    std::vector<int> feature;
    std::vector<float> u, v, limit;  ///< limit: of the squared distance to the line, px^2
    std::vector<Descriptor> descriptor;
  };
  void list_loose(const KeyFrameCopy& b);
  void match(const KeyFrameCopy& a, const KeyFrameCopy& b);

  Loose loose_;
  std::vector<int> candidates_;
  std::vector<std::uint16_t> distances_;
  std::vector<std::pair<int, int>> matches_;  ///< features of a and b
};

}  // namespace slambed
