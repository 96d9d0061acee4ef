// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "base/ids.hpp"
#include "map/map.hpp"
#include "optimize/bundle_adjuster.hpp"
#include "slam/bundle_window.hpp"

namespace slambed {

struct LocalMapperOptions {
  int neighbors = 10;        ///< best covisibles used for triangulation and fusion
  int neighbors_mono = 20;   ///< the same for mono, where every point must be triangulated
  int second_neighbors = 5;  ///< of each neighbor, for fusion
  /// ORB-SLAM2's KeyFrameCulling: a keyframe is culled if more than this share of its close points
  /// (mono: all points) has a weight above 3 and is seen by at least 3 others, at most one octave
  /// coarser (`keyframe_culling.cpp`).
  double redundant_share = 0.9;
  /// Measures the age of a new point by keyframe ids instead of by keyframes mapped since. As in
  /// Edge-SLAM, ids also count keyframes that were made but never arrived.
  bool ages_by_id = false;
  BundleOptions bundle;
  std::optional<BundleLimits::Size> bundle_size{};  ///< nothing: as ORB-SLAM2

  int neighbors_for(const Sensor& sensor) const {
    return sensor.metric() ? neighbors : neighbors_mono;
  }
};

/// ORB-SLAM2's local mapping, one call per stage. Each call reads the map, computes without its
/// lock and returns a delta. The caller commits it, so that in virtual time effects appear when the
/// work is done. Order per keyframe: insert, cull_points, triangulate, fuse, begin_bundle /
/// step_bundle / finish_bundle, cull_keyframes.
class LocalMapper {
 public:
  /// Number of later keyframes during which a new point can still be culled for few observations.
  static constexpr int kProbationKeyFrames = 3;

  LocalMapper(LocalMapperOptions options, std::shared_ptr<Map> map, IdSpace ids);
  ~LocalMapper();

  /// The keyframe is already in the map; its new points enter the list of recent ones.
  void insert(KeyFrameId keyframe);
  MapDelta cull_points();
  MapDelta triangulate();
  MapDelta fuse();
  /// False when there is nothing to optimize, for example with fewer than three keyframes.
  bool begin_bundle();
  /// Runs one iteration; false when finished. The caller may stop early, but before the robust
  /// stage is done there is no result.
  bool step_bundle();
  MapDelta finish_bundle();
  /// Observations in the current bundle, which determine the cost of a step.
  std::size_t bundle_observations() const;
  MapDelta cull_keyframes();

  /// Continues on another map (hand-over); pending work is dropped.
  void replace_map(std::shared_ptr<Map> map);
  /// Applies to bundles that begin from now on.
  void limit_bundles(const BundleLimits& limits);
  /// Gives later points ids above this one.
  void skip(MapPointId used);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
