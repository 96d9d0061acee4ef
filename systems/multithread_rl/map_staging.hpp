// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "multithread_rl/keyframe_backup.hpp"
#include "multithread_rl/recovery_backup.hpp"

namespace slambed {

/// Holds a mobile's two maps: tracking works on the active one while a worker builds an update in
/// the staging one. Keyframes made meanwhile are backed up and carried over, so that none is
/// missing after the swap. The worker and tracking each call only their own functions.
class MapStaging {
 public:
  enum class Backup {
    kNone,       ///< nothing is carried over
    kUpdate,     ///< keyframes made since the update began
    kUncovered,  ///< also earlier keyframes that the update does not cover
  };
  /// recovery_keyframes: see RecoveryBackup.
  MapStaging(std::shared_ptr<Map> active, Backup backup, int recovery_keyframes = 0);

  // For the worker. It may begin when idle, and prepare until set_ready().
  bool idle() const;
  /// Starts backing up keyframes.
  void begin();
  /// Abandons the update and what was built of it.
  void cancel();
  /// Puts the update into the empty staging map.
  void insert(const MapDelta& update, KeyFrameId newest);
  /// Determines which keyframes both maps have, and how they moved.
  void relate();
  /// Carries over all backed-up keyframes and returns how many staging received. After set_ready(),
  /// only tracking may call it.
  std::size_t drain();
  std::size_t waiting() const;
  /// Hands the staging map to tracking, which may swap the maps.
  void set_ready();

  // For tracking.
  bool ready() const;
  void keyframe_created(KeyFrameId keyframe, bool provisional);
  /// The camera was relocalized at this keyframe, which is carried over with every kind of backup.
  void recovered(KeyFrameId reference);
  const std::shared_ptr<Map>& active() const { return active_; }
  const std::shared_ptr<Map>& staging() const { return staging_; }
  /// Carried-over keyframes that the edge may still decline, ascending.
  std::vector<KeyFrameId> provisional() const;
  std::size_t carried() const { return carried_.size(); }
  /// Swaps the maps. The staging map then still has the content of the old active one.
  void swap();
  void clean() { staging_->clear(); }
  /// Lets the next update begin.
  void release();

 private:
  enum class Phase { kIdle, kUpdating, kReady };
  /// Puts these in front of the keyframes that wait already.
  void put_first(std::vector<BackedKeyFrame> keyframes);

  Backup backup_;
  std::shared_ptr<Map> active_, staging_;
  std::vector<KeyFrameId> updated_;      ///< the update's own keyframes
  SharedKeyFrames shared_;               ///< used by the side that prepares
  std::vector<BackedKeyFrame> carried_;  ///< likewise; in order

  mutable std::mutex mutex_;  ///< guards what follows
  Phase phase_ = Phase::kIdle;
  std::deque<BackedKeyFrame> backlog_;
  std::vector<KeyFrameId> provisional_;  ///< of the active map
  RecoveryBackup recovery_;
};

}  // namespace slambed
