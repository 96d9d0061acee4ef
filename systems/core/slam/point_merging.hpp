// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "map/slot_table.hpp"
#include "slam/keyframe_copy.hpp"
#include "slam/matching.hpp"

namespace slambed {

/// Fuses map points that are duplicates: projects a keyframe's points into its neighbors and theirs
/// into it. A match with a free feature attaches the point; a match with another point fuses them,
/// and the better observed one survives. Works on a copy that includes its own edits.
class PointMerging {
 public:
  MapDelta run(const Map& map, KeyFrameId keyframe, int neighbors, int second_neighbors);

 private:
  struct Point {
    PointSketch sketch;
    int weight = 0;
    int survivor = -1;                ///< index of the point that it was fused into
    std::vector<std::uint64_t> seen;  ///< one bit per keyframe in keyframes_
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
  std::vector<std::vector<int>> slots_;  ///< per keyframe and feature: index into points_ or -1
  std::vector<Point> points_;
  SlotTable<MapPointId, Place> places_;
  std::uint32_t run_ = 0;
  Matcher matcher_;
};

}  // namespace slambed
