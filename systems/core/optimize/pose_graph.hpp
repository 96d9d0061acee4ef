// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/sim3.hpp"

namespace slambed {

/// S_to_from as it was measured: S_to ~ S_to_from * S_from.
struct PoseGraphEdge {
  std::uint32_t from = 0, to = 0;
  Sim3 S_to_from;
};

struct PoseGraphProblem {
  std::vector<Sim3> S_cw;
  std::vector<std::uint8_t> fixed;  ///< per pose; at least one should be
  std::vector<PoseGraphEdge> edges;
  bool fix_scale = true;  ///< scales stay as they are: rigid motions, six degrees of freedom
};

struct PoseGraphOptions {
  int iterations = 20;
  /// Ends when the cost falls by less than this share; 0: only when it cannot fall any more.
  double relative_stop = 1e-6;
};

/// Poses that agree best with measured relative poses: least squares over the tangents of
/// S_to_from * S_from * S_to^-1, all components weighing the same (ORB-SLAM2's essential graph).
/// Levenberg-Marquardt, one iteration per step().
class PoseGraph {
 public:
  explicit PoseGraph(PoseGraphProblem problem, PoseGraphOptions options = {});
  ~PoseGraph();
  PoseGraph(PoseGraph&&) noexcept;

  /// Runs one iteration and returns true; false, without any work, when finished.
  bool step();
  /// Sum of squares over all edges.
  double cost() const;
  const PoseGraphProblem& problem() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
