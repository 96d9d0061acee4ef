// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/ids.hpp"
#include "map/map.hpp"
#include "optimize/bundle_adjuster.hpp"
#include "slam/bundle_window.hpp"

namespace slambed {

struct LocalMapperOptions {
  int neighbors = 10;        ///< best covisibles used for triangulation and fusion ...
  int neighbors_mono = 20;   ///< ... where every point must be triangulated
  int second_neighbors = 5;  ///< of each neighbor, for fusion
  /// ORB-SLAM2's KeyFrameCulling: a keyframe goes when more than this share of its close points
  /// (without depth: all) has a weight above 3 and is seen by at least 3 others, at most one octave
  /// coarser (`keyframe_culling.cpp`).
  double redundant_share = 0.9;
  /// How old a new point is: by the ids of keyframes, which also count those that were made and
  /// never came (Edge-SLAM), instead of by the keyframes mapped since.
  bool ages_by_id = false;
  BundleOptions bundle;

  int neighbors_for(const Sensor& sensor) const {
    return sensor.metric() ? neighbors : neighbors_mono;
  }
};

/// ORB-SLAM2's local mapping, one call per stage. Each call reads the map, computes without holding
/// it and returns the delta; the caller commits it, so that in virtual time effects appear when the
/// work is done. Order per keyframe: insert, cull_points, triangulate, fuse, begin_bundle /
/// step_bundle / finish_bundle, cull_keyframes.
class LocalMapper {
 public:
  /// Keyframes after its own until a point is culled for its observations no more.
  static constexpr int kProbationKeyFrames = 3;

  LocalMapper(LocalMapperOptions options, std::shared_ptr<Map> map, IdSpace ids);
  ~LocalMapper();

  /// The keyframe is already in the map; its new points enter the list of recent ones.
  void insert(KeyFrameId keyframe);
  MapDelta cull_points();
  MapDelta triangulate();
  MapDelta fuse();
  /// False when there is nothing to optimize (fewer than three keyframes).
  bool begin_bundle();
  /// One iteration; false when finished. Stop calling it to interrupt; before the robust stage is
  /// done there is no result then.
  bool step_bundle();
  MapDelta finish_bundle();
  /// Observations in the bundle at hand: what its steps cost time for.
  std::size_t bundle_observations() const;
  MapDelta cull_keyframes();

  /// Continues on another map (hand-over); pending work is dropped.
  void replace_map(std::shared_ptr<Map> map);
  /// For bundles that begin from now on.
  void limit_bundles(const BundleLimits& limits);
  /// Makes its next points with ids behind this one.
  void skip(MapPointId used);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
