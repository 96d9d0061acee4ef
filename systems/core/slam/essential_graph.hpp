// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "optimize/pose_graph.hpp"
#include "slam/loop_correction.hpp"

namespace slambed {

/// Pairs of keyframes (older, newer) that closed a loop.
using LoopEdges = std::set<std::pair<KeyFrameId, KeyFrameId>>;

/// Distributes a loop's correction over the whole map: the spanning tree, strong covisibility and
/// earlier loops keep their old relative poses, the new links keep the corrected ones.
class EssentialGraph {
 public:
  /// Call it after the loop's delta was committed.
  EssentialGraph(const Map& map, const LoopCorrection& loop, const LoopEdges& earlier,
                 const PoseGraphOptions& options = {});

  bool step() { return graph_->step(); }
  double cost() const { return graph_->cost(); }
  std::size_t edges() const { return graph_->problem().edges.size(); }
  /// All poses and points; the origin stays where it was before the loop.
  MapDelta result(const Map& map) const;

 private:
  std::vector<KeyFrameId> ids_;  ///< ascending; per pose of the graph
  std::vector<Sim3> start_;      ///< as corrected by the loop
  KeyFrameId origin_;
  Sim3 origin_before_;
  std::vector<std::pair<MapPointId, KeyFrameId>> anchors_;
  std::unique_ptr<PoseGraph> graph_;
};

}  // namespace slambed
