// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "offload/edge/edge_mapper.hpp"

namespace slambed {

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct UpdateSenderOptions {
  int keyframes;    ///< n_KF: the latest mapped keyframes that an update carries
  int neighbors;    ///< best covisibles of the newest one besides
  Duration period;  ///< at least so long between two updates; 0: after each keyframe
  std::optional<Duration>
      first{};         ///< when the first one is due; nothing: one period after the start
  bool poses;          ///< an update also says where other keyframes moved
  bool keep_recovery;  ///< see UpdateSender::recovered
  MessageCodec codec;
};

/// Sends parts of the global map to the mobile: the latest keyframes when they are due, on the
/// mapping worker, and whatever relocalization asks for, on its own. Of keyframes that the global
/// map begins with an update tells only where they moved since then.
class UpdateSender {
 public:
  UpdateSender(EdgeNode& node, EdgeMapper& mapper, UpdateSenderOptions options, Channel& channel);

  /// A keyframe was mapped: there is news, which leaves at once if it is due.
  void mapped(Worker& worker, const wire::UpdateTimes& times);
  /// Returns when it wants to be called again.
  RunTime send_if_due(Worker& worker);
  /// Sends these keyframes as a local map; newest and times describe the last mapped keyframe.
  void send(Worker& worker, wire::UpdateTimes times, KeyFrameId newest,
            const std::vector<KeyFrameId>& keyframes, bool relocalization);

  /// The mobile asked where it is, at this time: regular updates pause until a later keyframe says
  /// that it knows again, so that none takes the place of the map that is the answer.
  void suspend(RunTime asked);
  /// It knows again, found at this keyframe: updates go on. Until as many keyframes as an update
  /// carries were made since then and mapped, none leaves for a while, and then they carry that one
  /// too, so that the first does not take the camera's place away.
  void recovered(RunTime found, KeyFrameId reference);
  /// A keyframe came: it knows where it is, and which update it has applied.
  void keyframe_received(const wire::KeyFrameMessage& keyframe);
  /// No map leaves, of any kind.
  void stop();
  /// Maps that leave carry the epoch.
  void resume(std::uint64_t epoch);
  /// The map begins anew, and so does what the mobile was told of it.
  void clear();

 private:
  struct SentPose {
    SE3 T_cw;
    std::uint64_t update = 0;  ///< the first that told it; 0: none had to
  };

  /// Of keyframes outside the update: what the mobile may not know yet.
  std::vector<KeyFramePose> moved_poses(const wire::MapUpdate& update);

  EdgeNode& node_;
  EdgeMapper& mapper_;
  UpdateSenderOptions options_;
  Channel& channel_;

  std::mutex mutex_;  ///< guards what follows
  wire::UpdateTimes newest_times_;
  bool news_ = false;                 ///< a keyframe was mapped since the last update
  std::optional<RunTime> suspended_;  ///< when the mobile asked where it is
  struct Recovery {
    KeyFrameId reference;
    RunTime found{};
    int to_come = 0;  ///< keyframes
  };
  std::optional<Recovery> recovery_;
  bool stopped_ = false;
  std::uint64_t epoch_ = 0;
  RunTime last_sent_ = RunTime::min();
  std::map<KeyFrameId, SentPose> sent_poses_;  ///< poses the mobile was told last
  std::uint64_t confirmed_ = 0;  ///< newest update that the mobile is known to have applied
};

}  // namespace slambed
