// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "map/map.hpp"
#include "optimize/bundle_adjuster.hpp"

namespace slambed {

/// A map as a problem to solve, and what its poses and points are called. No points: there is
/// nothing to move.
struct WholeMap {
  std::vector<KeyFrameId> keyframes;  ///< per pose of the problem, the origin last
  std::vector<MapPointId> points;
  BundleProblem problem;
};
/// Reads the map part by part: others may change it meanwhile.
WholeMap collect(const Map& map);

/// Bundle adjustment of a whole map, the origin held. It works on a copy and takes steps; the map
/// may grow and change meanwhile: the result is carried over to what was added.
class GlobalBundle {
 public:
  /// Nothing when there is nothing to move.
  static std::optional<GlobalBundle> of(const Map& map, const BundleOptions& options);

  bool step() { return adjuster_->step(); }
  double cost() const { return adjuster_->robust_cost(); }
  std::size_t observations() const { return adjuster_->problem().observations.size(); }
  /// Against the map as it is now, which must not change until the delta is committed.
  MapDelta result(const Map& map) const;

 private:
  std::vector<KeyFrameId> keyframes_;  ///< per pose of the problem
  std::vector<MapPointId> points_;     ///< per point
  std::unique_ptr<BundleAdjuster> adjuster_;
};

}  // namespace slambed
