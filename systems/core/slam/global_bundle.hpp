// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "map/map.hpp"
#include "optimize/bundle_adjuster.hpp"

namespace slambed {

/// A map as a bundle adjustment problem, with the ids of its poses and points. Without points there
/// is nothing to move.
struct WholeMap {
  std::vector<KeyFrameId> keyframes;  ///< per pose of the problem, the origin last
  std::vector<MapPointId> points;
  BundleProblem problem;
};
/// Reads the map in parts, so that others can change it in between.
WholeMap collect(const Map& map);

/// Bundle adjustment of a whole map with the origin fixed. It works on a copy, step by step. The
/// map may change meanwhile: the result is carried over to elements added since.
class GlobalBundle {
 public:
  /// Returns nothing if there is nothing to move.
  static std::optional<GlobalBundle> of(const Map& map, const BundleOptions& options);

  bool step() { return adjuster_->step(); }
  double cost() const { return adjuster_->robust_cost(); }
  std::size_t observations() const { return adjuster_->problem().observations.size(); }
  /// Returns a delta for the current map, which must not change until the delta is committed.
  MapDelta result(const Map& map) const;

 private:
  std::vector<KeyFrameId> keyframes_;  ///< per pose of the problem
  std::vector<MapPointId> points_;     ///< per point
  std::unique_ptr<BundleAdjuster> adjuster_;
};

}  // namespace slambed
