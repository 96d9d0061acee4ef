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
  int keyframes;    ///< n_KF: number of latest mapped keyframes in an update
  int neighbors;    ///< number of best covisibles of the newest keyframe added to them
  Duration period;  ///< least time between two updates; 0: one after each keyframe
  std::optional<Duration>
      first{};         ///< when the first one is due; nothing: one period after the start
  bool poses;          ///< an update also carries poses of other keyframes that moved
  bool keep_recovery;  ///< see UpdateSender::recovered
  MessageCodec codec;
};

/// Sends parts of the global map to the mobile. The mapping worker sends the latest keyframes when
/// they are due; the relocalization worker sends what relocalization needs. Poses of prior-map
/// keyframes are sent only if they moved since the start.
class UpdateSender {
 public:
  UpdateSender(EdgeNode& node, EdgeMapper& mapper, UpdateSenderOptions options, Channel& channel);

  /// A keyframe was mapped. Sends an update at once if one is due.
  void mapped(Worker& worker, const wire::UpdateTimes& times);
  /// Sends an update if one is due. Returns when it wants to be called again.
  RunTime send_if_due(Worker& worker);
  /// Sends these keyframes as a local map. newest: the last mapped keyframe; times: its timestamps,
  /// or those of a relocalization request.
  void send(Worker& worker, wire::UpdateTimes times, KeyFrameId newest,
            const std::vector<KeyFrameId>& keyframes, bool relocalization);

  /// The mobile asked at this time to be relocalized. Regular updates pause until a later keyframe
  /// shows that it tracks again, so that none replaces the relocalization map.
  void suspend(RunTime asked);
  /// The mobile tracks again, found at this keyframe: updates continue. With keep_recovery, until
  /// n_KF keyframes made since then are mapped, updates wait a while and then also carry this
  /// keyframe. Otherwise the first one would remove the place where the camera is.
  void recovered(RunTime found, KeyFrameId reference);
  /// A keyframe arrived: it shows that the mobile tracks, and which update it has applied.
  void keyframe_received(const wire::KeyFrameMessage& keyframe);
  /// Stops sending maps, also those for relocalization.
  void stop();
  /// Resumes sending; maps carry the epoch from now on.
  void resume(std::uint64_t epoch);
  /// The map starts over: forgets which poses were sent.
  void clear();

 private:
  struct SentPose {
    SE3 T_cw;
    std::uint64_t update = 0;  ///< first update that carried this pose; 0: stored in the prior map
  };

  /// Returns the poses of keyframes outside the update that the mobile may not have yet.
  std::vector<KeyFramePose> moved_poses(const wire::MapUpdate& update);

  EdgeNode& node_;
  EdgeMapper& mapper_;
  UpdateSenderOptions options_;
  Channel& channel_;

  std::mutex mutex_;  ///< guards what follows
  wire::UpdateTimes newest_times_;
  bool news_ = false;                 ///< a keyframe was mapped since the last update
  std::optional<RunTime> suspended_;  ///< when the mobile asked to be relocalized
  struct Recovery {
    KeyFrameId reference;
    RunTime found{};
    int to_come = 0;  ///< keyframes still to be mapped
  };
  std::optional<Recovery> recovery_;
  bool stopped_ = false;
  std::uint64_t epoch_ = 0;
  RunTime last_sent_ = RunTime::min();
  std::map<KeyFrameId, SentPose> sent_poses_;  ///< poses last sent to the mobile
  std::uint64_t confirmed_ = 0;  ///< newest update that the mobile is known to have applied
};

}  // namespace slambed
