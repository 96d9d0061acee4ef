// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "map/map.hpp"
#include "optimize/bundle_adjuster.hpp"
#include "optimize/pose_graph.hpp"
#include "slam/loop_detector.hpp"
#include "slam/loop_verifier.hpp"

namespace slambed {

struct LoopCloserOptions {
  LoopDetectorOptions detector;
  LoopVerifierOptions verifier;
  PoseGraphOptions graph;
  BundleOptions bundle{.robust_iterations = 10, .final_iterations = 0};
};

/// ORB-SLAM2's loop closing, one call per stage. Each call reads the map, computes without holding
/// it and returns the delta; the caller commits it. Per keyframe that mapping is done with: detect,
/// then where it says so verify, then where that says so
///   correct - commit - begin_graph / step_graph / finish_graph - commit
/// with nobody else changing the map, and begin_bundle / step_bundle / finish_bundle - commit in
/// the background: mapping may go on during its steps, only between finish_bundle and its commit
/// the map must rest. A bundle that is begun again, or a correction, ends the one under way.
class LoopCloser {
 public:
  LoopCloser(LoopCloserOptions options, std::shared_ptr<Map> map,
             const std::shared_ptr<PlaceIndex>& places);
  ~LoopCloser();

  /// True when the keyframe looks like an old part of the map.
  bool detect(KeyFrameId keyframe);
  /// True when one of the candidates is one: a loop.
  bool verify();
  /// Puts the keyframe and its neighbors in their place and joins both parts of the map.
  MapDelta correct();

  bool begin_graph();
  bool step_graph();
  MapDelta finish_graph();

  bool begin_bundle();
  bool step_bundle();
  MapDelta finish_bundle();

  /// The loop found last; keyframes are none before the first.
  const LoopMatch& loop() const;

  /// Continues on another map; pending work is dropped.
  void replace_map(std::shared_ptr<Map> map);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
