// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "map/map.hpp"
#include "slam/place_index.hpp"

namespace slambed {

/// ORB-SLAM2's limits.
struct LoopDetectorOptions {
  int quiet_keyframes = 10;  ///< keyframes skipped after a closed loop
  int consistency = 3;       ///< earlier keyframes that must have led to the same part of the map
  /// Number of best candidates that are considered. ORB-SLAM2 considers all, which in a large map
  /// of similar places is most of the map.
  std::size_t candidates = 20;
};

/// Detects keyframes that look like an old part of the map: at least as similar as their own
/// covisibles, not connected to them, and several times in a row.
class LoopDetector {
 public:
  LoopDetector(LoopDetectorOptions options, std::shared_ptr<PlaceIndex> places)
      : options_(options), places_(std::move(places)) {}

  /// Keyframes that may close a loop with this one, best first. Updates the index from the map.
  std::vector<KeyFrameId> detect(const Map& map, KeyFrameId keyframe);
  /// Call it when a loop was closed; the next keyframes are then skipped.
  void closed();
  /// Clears the history, for another map.
  void reset();

 private:
  /// A candidate and all keyframes that share a point with it.
  struct Group {
    std::vector<KeyFrameId> keyframes;  ///< ascending
    int seen = 0;                       ///< earlier keyframes in a row that led to it
  };

  LoopDetectorOptions options_;
  std::shared_ptr<PlaceIndex> places_;
  std::vector<Group> groups_;  ///< of the previous keyframe
  int quiet_ = 0;              ///< keyframes still to skip
};

}  // namespace slambed
