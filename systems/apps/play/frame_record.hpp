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

/// An event of the system's own, as it sent it: a JSON object with a type, whose values are taken
/// one by one. bad_input for anything else.
JsonLine system_event(std::string_view text);

/// What a system said of its frames becomes the events and trajectories that every system leaves.
/// A frame that was taken and of which nothing was said until a later one was is one without a
/// pose.
class FrameRecord {
 public:
  explicit FrameRecord(EventLog& log) : log_(log) {}

  void dequeued(const OfferedFrame& frame, std::int64_t recorded_ns);
  /// bad_input for a frame that is not waiting for its pose, or numbers that are none.
  void tracked(const slambed_pose& pose, RunTime now);
  /// bad_input for a frame that was never tracked, or numbers that are none.
  void placed(const slambed_pose& pose);
  /// Playback is over: what still waits for a pose has none.
  void over(RunTime now);
  bool lost() const { return losses_ > 0; }

  /// trajectory_live.txt and trajectory.txt; without final poses both are the live ones.
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
