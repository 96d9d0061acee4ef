// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <optional>

#include "multithread_rl/map_staging.hpp"
#include "offload/downlink/update_applier.hpp"

namespace slambed {

/// Updates as in Multithread: a worker parses an update, checks it and builds it in a staging map,
/// with the keyframes made meanwhile. Between two frames, tracking carries over its last frame,
/// swaps the maps and clears the old one. Of the updates that wait only the newest is kept.
class StagedUpdates final : public UpdateApplier {
 public:
  StagedUpdates(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check,
                MapStaging::Backup backup, int recovery_keyframes);
  void start() override;
  void before_frame(Worker& worker) override;
  void keyframe_created(KeyFrameId keyframe, bool provisional) override {
    staging_.keyframe_created(keyframe, provisional);
  }
  void suspend(bool suspended) override;
  /// Swaps a prepared update in together with the keyframe at which the camera was relocalized.
  void recovered(RunTime when, KeyFrameId reference) override;

 private:
  void work(Worker& worker);
  void prepare(Worker& worker, Message message);
  void catch_up(Worker& worker);
  void insert_backlog(Worker& worker);
  void exchange_maps(Worker& worker, UpdateArrival arrival);

  bool keeps_recovery_;
  MapStaging staging_;
  Mailbox<UpdateArrival> prepared_;     ///< the update in the staging map, once ready
  std::atomic<bool> suspended_{false};  ///< set by tracking
  bool waited_ = false;  ///< tracking only: the prepared update has waited for a recovery
  Mailbox<UpdateArrival> declined_;  ///< declined before preparation; their poses may still be new
};

}  // namespace slambed
