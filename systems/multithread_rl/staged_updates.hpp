// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <optional>

#include "multithread_rl/map_staging.hpp"
#include "offload/downlink/update_applier.hpp"

namespace slambed {

/// Multithread's way: a worker judges, reads and puts the update together in a staging map, with
/// the keyframes that were made meanwhile; between two frames tracking carries its last frame over,
/// swaps the two maps and empties the former one. One update at a time; of those that wait the
/// newest stays.
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
  /// What waits is swapped in with the keyframe at which the camera was found.
  void recovered(RunTime when, KeyFrameId reference) override;

 private:
  void work(Worker& worker);
  void prepare(Worker& worker, Message message);
  void catch_up(Worker& worker);
  void insert_backlog(Worker& worker);
  void exchange_maps(Worker& worker, UpdateArrival arrival);

  bool keeps_recovery_;
  MapStaging staging_;
  Mailbox<UpdateArrival> prepared_;     ///< what the staging map holds once it is ready
  std::atomic<bool> suspended_{false};  ///< set by tracking
  bool waited_ = false;                 ///< tracking's: what is prepared has waited for a recovery
  Mailbox<UpdateArrival> declined_;     ///< at their begin; they may tell poses
};

}  // namespace slambed
