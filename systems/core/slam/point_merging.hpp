// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "map/slot_table.hpp"
#include "slam/keyframe_copy.hpp"
#include "slam/matching.hpp"

namespace slambed {

/// Merges (fuses) map points that are the same thing seen twice: projects a keyframe's points into
/// its neighbors and theirs into it. A hit on a free feature attaches, a hit on another point
/// fuses; the better observed one survives. Works on a copy that follows its own edits.
class PointMerging {
 public:
  MapDelta run(const Map& map, KeyFrameId keyframe, int neighbors, int second_neighbors);

 private:
  struct Point {
    PointSketch sketch;
    int weight = 0;
    int survivor = -1;                ///< place of the point it was fused into
    std::vector<std::uint64_t> seen;  ///< bit per place in keyframes_
  };
  struct Place {
    std::uint32_t run = 0;
    int index = 0;
  };

  bool copy(const Map& map, KeyFrameId keyframe, int neighbors, int second_neighbors);
  int alive(int point) const;
  void project_into(int keyframe, std::span<const int> points, MapDelta& delta);
  void attach(int keyframe, int feature, int point, MapDelta& delta);
  void fuse(int gone, int survivor, MapDelta& delta);

  std::vector<KeyFrameCopy> keyframes_;  ///< the current one first
  std::vector<std::vector<int>> slots_;  ///< per keyframe and feature: place in points_ or -1
  std::vector<Point> points_;
  SlotTable<MapPointId, Place> places_;
  std::uint32_t run_ = 0;
  Matcher matcher_;
};

}  // namespace slambed
