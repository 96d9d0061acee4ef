// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/sim3.hpp"

namespace slambed {

/// Measured relative pose: S_to ~ S_to_from * S_from.
struct PoseGraphEdge {
  std::uint32_t from = 0, to = 0;
  Sim3 S_to_from;
};

struct PoseGraphProblem {
  std::vector<Sim3> S_cw;
  std::vector<std::uint8_t> fixed;  ///< per pose; at least one should be
  std::vector<PoseGraphEdge> edges;
  bool fix_scale = true;  ///< keep scales: rigid motions with six degrees of freedom
};

struct PoseGraphOptions {
  int iterations = 20;
  /// Ends when the cost falls by less than this share. 0: only when it cannot fall further.
  double relative_stop = 1e-6;
};

/// Pose graph optimization: least squares over the tangents of S_to_from * S_from * S_to^-1, all
/// components with equal weight (ORB-SLAM2's essential graph). Levenberg-Marquardt, one iteration
/// per step().
class PoseGraph {
 public:
  explicit PoseGraph(PoseGraphProblem problem, PoseGraphOptions options = {});
  ~PoseGraph();
  PoseGraph(PoseGraph&&) noexcept;

  /// Runs one iteration and returns true, or returns false when finished.
  bool step();
  /// Sum of squares over all edges.
  double cost() const;
  const PoseGraphProblem& problem() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
