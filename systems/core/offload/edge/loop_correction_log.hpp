// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <utility>

#include "map/map.hpp"

namespace slambed {

/// Which loop corrections the mobile's updates know of. A closed loop moves whole parts of the
/// edge's map at once, while the mobile goes on in the map as it was until an update brings it the
/// new one. What it sends meanwhile is corrected likewise.
/// Thread-safe.
class LoopCorrectionLog {
 public:
  /// Reads the map for an update: read(number), which counts from 1. No correction comes in
  /// between, so that the number tells which corrections the update knows of.
  template <typename Read>
  auto update(Read read) {
    std::lock_guard lock(mutex_);
    return read(++updates_);
  }
  /// The same for somebody whose last update had the number applied: read(number, corrected),
  /// whether a loop correction has moved the map since then.
  template <typename Read>
  auto update(std::uint64_t applied, Read read) {
    std::lock_guard lock(mutex_);
    const bool corrected = !corrections_.empty() && corrections_.back().updates >= applied;
    return read(++updates_, corrected);
  }
  /// How many loop corrections have moved the map so far.
  std::uint64_t count() const { return count_; }
  /// Commits a change that may move keyframes by more than the mapper does.
  void commit(Map& map, const MapDelta& delta);
  /// The keyframe and its new points as they fit the map now, when the mobile made them on a map
  /// from before a correction: moved as the old keyframe was that shares most points with it.
  /// applied: the last update it had applied.
  MapDelta correct(const Map& map, MapDelta made, std::uint64_t applied);
  /// The mobile has the map as it is.
  void forget();

 private:
  using Poses = std::map<KeyFrameId, SE3>;
  struct Correction {
    std::uint64_t updates = 0;  ///< read until then: who has no later one is on the old map
    Poses before;               ///< T_cw
  };

  std::mutex mutex_;                    ///< guards what follows; taken before a map's lock
  std::uint64_t updates_ = 0;           ///< read so far
  std::deque<Correction> corrections_;  ///< oldest first
  std::atomic<std::uint64_t> count_{0};
};

}  // namespace slambed
