// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "base/ids.hpp"
#include "offload/recovery_backup.hpp"
#include "offload/update_exchange.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

/// The way of an update from the inbox into the tracker, and on which worker each step is done.
class UpdatePath {
 public:
  virtual ~UpdatePath() = default;
  virtual void start() {}
  /// On the tracking worker, between two frames: the place where the local map may be replaced.
  virtual void before_frame(Worker& worker) = 0;
  /// On the tracking worker: a keyframe was added to the local map. provisional: it is no reference
  /// until the edge has accepted it.
  virtual void keyframe_created(KeyFrameId, bool /*provisional*/) {}
  /// On the tracking worker: no update is applied until it is called again.
  virtual void suspend(bool /*suspended*/) {}
  /// On the tracking worker: tracking was lost and goes on, found at this keyframe.
  virtual void recovered(RunTime, KeyFrameId) {}
};

/// Everything (parsing, building the new map, disposing of the old one) on the tracking worker, as
/// in Edge-SLAM.
class SerialUpdates final : public UpdatePath {
 public:
  /// recovery_keyframes: see RecoveryBackup.
  SerialUpdates(MobileNode& node, UpdateInbox& inbox, UpdateExchange& exchange,
                int recovery_keyframes)
      : node_(node), inbox_(inbox), exchange_(exchange), backup_(recovery_keyframes) {}
  void before_frame(Worker& worker) override;
  void keyframe_created(KeyFrameId keyframe, bool provisional) override {
    backup_.keyframe_created(keyframe, provisional);
  }
  void suspend(bool suspended) override { suspended_ = suspended; }
  void recovered(RunTime when, KeyFrameId reference) override {
    recovery_ = {when, reference};
    backup_.recovered(reference);
  }

 private:
  struct Recovery {
    RunTime when{};
    KeyFrameId reference;
  };
  /// It was sent before the camera was found again, and shows another place.
  bool is_elsewhere(const UpdateArrival& arrival) const;
  /// Carries over what the update does not hold of the place where the camera was found.
  std::vector<BackedKeyFrame> keep_recovery(Worker& worker, const UpdateArrival& arrival) const;

  MobileNode& node_;
  UpdateInbox& inbox_;
  UpdateExchange& exchange_;
  bool suspended_ = false;
  std::optional<Recovery> recovery_;
  RecoveryBackup backup_;
};

/// A worker parses and builds; tracking judges and swaps; the worker disposes of the old map.
class ParallelUpdates final : public UpdatePath {
 public:
  /// waits: between two frames tracking stands still while the worker is at an update.
  ParallelUpdates(MobileNode& node, UpdateInbox& inbox, UpdateExchange& exchange, bool waits);
  void start() override;
  void before_frame(Worker& worker) override;

 private:
  void work(Worker& worker);

  MobileNode& node_;
  UpdateInbox& inbox_;
  UpdateExchange& exchange_;
  bool waits_;
  std::atomic<bool> working_{false};       ///< the worker is at an update
  Mailbox<UpdateArrival> ready_;           ///< built by the worker
  Mailbox<UpdateArrival> replaced_;        ///< by a newer one, before tracking looked
  Mailbox<std::shared_ptr<Map>> disused_;  ///< to be disposed of by the worker
};

}  // namespace slambed
