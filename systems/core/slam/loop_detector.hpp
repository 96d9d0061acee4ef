// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "map/map.hpp"
#include "slam/place_index.hpp"

namespace slambed {

/// ORB-SLAM2's limits.
struct LoopDetectorOptions {
  int quiet_keyframes = 10;  ///< after a loop that was closed
  int consistency = 3;       ///< keyframes before this one that led to the same part of the map
  /// Best groups looked at. ORB-SLAM2 looks at all, and in a large map whose places look alike that
  /// is most of the map.
  std::size_t candidates = 20;
};

/// Watches keyframe after keyframe for one that looks like an old part of the map: as similar as
/// its own neighbors are, not connected to them, and several times running.
class LoopDetector {
 public:
  LoopDetector(LoopDetectorOptions options, std::shared_ptr<PlaceIndex> places)
      : options_(options), places_(std::move(places)) {}

  /// Keyframes that may close a loop with this one, best first. Takes the keyframe into the index.
  std::vector<KeyFrameId> detect(const Map& map, KeyFrameId keyframe);
  /// A loop was closed: be quiet for a while.
  void closed();
  /// Forgets what led here (another map).
  void reset();

 private:
  /// A candidate with everything that shares a point with it.
  struct Group {
    std::vector<KeyFrameId> keyframes;  ///< ascending
    int seen = 0;                       ///< times running that a keyframe led to it
  };

  LoopDetectorOptions options_;
  std::shared_ptr<PlaceIndex> places_;
  std::vector<Group> groups_;  ///< of the keyframe before
  int quiet_ = 0;              ///< keyframes still to let pass
};

}  // namespace slambed
