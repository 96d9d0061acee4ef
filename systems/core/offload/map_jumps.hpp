// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <mutex>

#include "map/map.hpp"

namespace slambed {

/// A closed loop moves whole parts of the edge's map at once, while the mobile goes on in the map as
/// it was until an update brings it the new one. What it sends meanwhile has to move along.
/// Thread-safe.
class MapJumps {
 public:
  /// Runs a change that may move the map; updates: number of the last one sent before.
  template <typename Change>
  void watch(const Map& map, std::uint64_t updates, Change change) {
    Poses before = poses(map);
    change();
    note(map, updates, std::move(before));
  }
  /// The keyframe and its new points as they fit the map now, when the mobile made them on a map
  /// from before a jump: moved as the old keyframe was that shares most points with it. applied:
  /// the last update it had taken over.
  MapDelta follow(const MapView& map, MapDelta made, std::uint64_t applied);
  /// The mobile has the map as it is.
  void forget();

 private:
  using Poses = std::map<KeyFrameId, SE3>;
  struct Jump {
    std::uint64_t updates = 0;  ///< sent until then: who has no later one is on the old map
    Poses before;               ///< T_cw
  };
  static Poses poses(const Map& map);
  void note(const Map& map, std::uint64_t updates, Poses before);

  std::mutex mutex_;        ///< guards what follows; taken after a map's lock
  std::deque<Jump> jumps_;  ///< oldest first
};

}  // namespace slambed
