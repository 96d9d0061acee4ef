// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "multithread_rl/recovery_backup.hpp"
#include "offload/downlink/update_applier.hpp"

namespace slambed {

/// Serial updates of a mobile that the edge relocalizes. None is applied during a loss, and the
/// first ones after a recovery keep the place where the camera was found.
class RecoveringUpdates final : public SerialUpdates {
 public:
  /// recovery_keyframes: see RecoveryBackup.
  RecoveringUpdates(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check,
                    int recovery_keyframes)
      : SerialUpdates(node, receiver, check),
        keeps_recovery_(recovery_keyframes > 0),
        backup_(recovery_keyframes) {}
  void before_frame(Worker& worker) override;
  void keyframe_created(KeyFrameId keyframe, bool provisional) override {
    backup_.keyframe_created(keyframe, provisional);
  }
  void suspend(bool suspended) override { suspended_ = suspended; }
  void recovered(RunTime when, KeyFrameId reference) override;

 private:
  struct Recovery {
    RunTime when{};
    KeyFrameId reference;
  };
  /// Declines an update that was sent before the recovery and shows another place.
  std::optional<std::string_view> additional_decline_reason(
      const UpdateArrival& arrival) const override;
  /// Carries over keyframes of the recovery's place that the update lacks.
  Carried carry_over(Worker& worker, const UpdateArrival& arrival) override;
  void applied(const UpdateArrival& arrival) override;

  bool keeps_recovery_;
  bool suspended_ = false;
  std::optional<Recovery> recovery_;
  RecoveryBackup backup_;
};

}  // namespace slambed
