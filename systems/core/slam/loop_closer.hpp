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

/// ORB-SLAM2's loop closing, one call per stage. Each call reads the map, computes without its lock
/// and returns a delta, which the caller commits. For each mapped keyframe: detect, and verify if
/// that returns true. If that returns true as well:
///   correct - commit - begin_graph / step_graph / finish_graph - commit
/// while nobody else changes the map, then begin_bundle / step_bundle / finish_bundle - commit in
/// the background. Mapping may continue during the bundle's steps, but the map must not change
/// between finish_bundle and its commit. A new bundle or a correction ends the current bundle.
class LoopCloser {
 public:
  LoopCloser(LoopCloserOptions options, std::shared_ptr<Map> map,
             const std::shared_ptr<PlaceIndex>& places);
  ~LoopCloser();

  /// True when the keyframe looks like an old part of the map.
  bool detect(KeyFrameId keyframe);
  /// True when one of the candidates closes a loop.
  bool verify();
  /// Moves the keyframe and its covisibles to their corrected poses and joins both map parts.
  MapDelta correct();

  bool begin_graph();
  bool step_graph();
  MapDelta finish_graph();

  bool begin_bundle();
  bool step_bundle();
  MapDelta finish_bundle();

  /// The last loop found; its keyframes are none before the first.
  const LoopMatch& loop() const;

  /// Continues on another map; pending work is dropped.
  void replace_map(std::shared_ptr<Map> map);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
