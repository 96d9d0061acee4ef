// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string_view>

#include "apps/play/client/slambed_client.h"
#include "node/event_log.hpp"
#include "node/playback.hpp"
#include "node/pose_log.hpp"

namespace slambed {

/// Parses an event that the system sent: a JSON object with a type. Throws bad_input for anything
/// else.
JsonLine system_event(std::string_view text);

/// Turns a system's poses into the events and trajectories that every system leaves. If the system
/// sends no pose for a frame before it answers a later one, that frame has no pose.
class FrameRecord {
 public:
  explicit FrameRecord(EventLog& log) : log_(log) {}

  void dequeued(const OfferedFrame& frame, std::int64_t recorded_ns);
  /// Records a pose. Throws bad_input if the frame does not wait for one, or the pose is invalid.
  void tracked(const slambed_pose& pose, RunTime now);
  /// Records a final pose. Throws bad_input if the frame was never tracked, or the pose is invalid.
  void placed(const slambed_pose& pose);
  /// Ends playback: frames that still wait for a pose have none.
  void over(RunTime now);
  bool lost() const { return losses_ > 0; }

  /// Writes trajectory_live.txt and trajectory.txt. Without final poses both have the live poses.
  void write_trajectories(const std::filesystem::path& folder) const;

 private:
  struct Dequeued {
    OfferedFrame offered;
    std::int64_t recorded_ns = 0;
  };
  void record(const Dequeued& frame, std::uint32_t state, RunTime now, const slambed_pose* pose);

  EventLog& log_;
  std::map<std::uint64_t, Dequeued> waiting_;
  std::map<std::uint64_t, std::int64_t> recorded_ns_;  ///< of every frame with a pose
  std::map<std::uint64_t, SE3> live_, final_;          ///< T_cw
  std::uint32_t state_ = SLAMBED_NOT_INITIALIZED;
  bool had_pose_ = false;
  int losses_ = 0;
};

}  // namespace slambed
