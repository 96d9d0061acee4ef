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

/// Tracks which loop corrections the mobile's updates include. A closed loop moves large parts of
/// the edge's map at once, while the mobile tracks in the old map until an update arrives. The
/// keyframes that it sends until then are corrected likewise. Thread-safe.
class LoopCorrectionLog {
 public:
  /// Calls read(number) to read the map for an update; numbers start at 1. No correction is
  /// committed during the call, so the number tells which corrections the update includes.
  template <typename Read>
  auto update(Read read) {
    std::lock_guard lock(mutex_);
    return read(++updates_);
  }
  /// Calls read(number, corrected) for a peer whose last update was `applied`. corrected: a loop
  /// correction has moved the map since then.
  template <typename Read>
  auto update(std::uint64_t applied, Read read) {
    std::lock_guard lock(mutex_);
    const bool corrected = !corrections_.empty() && corrections_.back().updates >= applied;
    return read(++updates_, corrected);
  }
  /// How many loop corrections have moved the map so far.
  std::uint64_t count() const { return count_; }
  /// Commits a change of loop closing, and logs it if it moved any keyframe.
  void commit(Map& map, const MapDelta& delta);
  /// Moves new keyframes and points if the mobile made them on a map from before a correction. They
  /// move as the old keyframe did that shares the most points with the first new one. applied: the
  /// last update that the mobile had applied.
  MapDelta correct(const Map& map, MapDelta made, std::uint64_t applied);
  /// Drops all corrections, because the mobile has the current map.
  void forget();

 private:
  using Poses = std::map<KeyFrameId, SE3>;
  struct Correction {
    std::uint64_t updates = 0;  ///< number of the last update before it
    Poses before;               ///< T_cw
  };

  std::mutex mutex_;                    ///< guards what follows; taken before a map's lock
  std::uint64_t updates_ = 0;           ///< number of the last update
  std::deque<Correction> corrections_;  ///< oldest first
  std::atomic<std::uint64_t> count_{0};
};

}  // namespace slambed
