// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "multithread_rl/keyframe_backup.hpp"
#include "multithread_rl/recovery_backup.hpp"

namespace slambed {

/// Two maps of a mobile: the active one, which tracking works on, and the staging one, in which a
/// worker puts an update together while tracking goes on. Keyframes made meanwhile are backed up
/// and carried over, so that none is missing after the swap. A plain module: one worker and
/// tracking call it, each its own part.
class MapStaging {
 public:
  enum class Backup {
    kNone,       ///< nothing is carried over
    kUpdate,     ///< what is made from the update's begin on
    kUncovered,  ///< also what was made before and the update does not cover
  };
  /// recovery_keyframes: see RecoveryBackup.
  MapStaging(std::shared_ptr<Map> active, Backup backup, int recovery_keyframes = 0);

  // The worker's. It may begin when idle, and prepare until it says ready.
  bool idle() const;
  /// Keyframes are backed up from now on.
  void begin();
  /// Gives the update up, or what was made of it: it never was.
  void cancel();
  /// Puts the update into the empty staging map.
  void insert(const MapDelta& update, KeyFrameId newest);
  /// Which keyframes both maps have, and how they moved.
  void relate();
  /// Carries over what is backed up so far; returns how many keyframes went into staging.
  /// Tracking's once ready.
  std::size_t drain();
  std::size_t waiting() const;
  /// Tracking may swap; the staging map is its own now.
  void set_ready();

  // Tracking's.
  bool ready() const;
  void keyframe_created(KeyFrameId keyframe, bool provisional);
  /// The camera was found at this keyframe, which is to be carried over, whatever the backup is.
  void recovered(KeyFrameId reference);
  const std::shared_ptr<Map>& active() const { return active_; }
  const std::shared_ptr<Map>& staging() const { return staging_; }
  /// Of what was carried over: keyframes that the edge may still decline, ascending.
  std::vector<KeyFrameId> provisional() const;
  std::size_t carried() const { return carried_.size(); }
  /// Staging becomes active; what was active is the next staging map and still has its content.
  void swap();
  /// Empties the staging map.
  void clean() { staging_->clear(); }
  /// The next update may begin.
  void release();

 private:
  enum class Phase { kIdle, kUpdating, kReady };
  /// Carries these over before what waits already.
  void put_first(std::vector<BackedKeyFrame> keyframes);

  Backup backup_;
  std::shared_ptr<Map> active_, staging_;
  std::vector<KeyFrameId> updated_;      ///< the update's own keyframes
  SharedKeyFrames shared_;               ///< the preparing side's
  std::vector<BackedKeyFrame> carried_;  ///< the same; in order

  mutable std::mutex mutex_;  ///< guards what follows
  Phase phase_ = Phase::kIdle;
  std::deque<BackedKeyFrame> backlog_;
  std::vector<KeyFrameId> provisional_;  ///< of the active map's own keyframes
  RecoveryBackup recovery_;
};

}  // namespace slambed
