// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>

#include "offload/downlink/update_receiver.hpp"
#include "offload/downlink/update_rules.hpp"

namespace slambed {

/// Decides by the rules whether a map update is applied, given the state of tracking, of the edge
/// and of the last applied update. Any worker may call it while tracking continues, except for the
/// functions marked as tracking's.
class UpdateCheck {
 public:
  UpdateCheck(MobileNode& node, UpdateRules rules) : node_(node), rules_(rules) {}

  /// Returns the reason why the rules decline the update, or nothing.
  std::optional<std::string_view> update_decline_reason(Worker& worker,
                                                        const UpdateArrival& arrival) const;
  /// Checks only the reasons that always rule out an update (edge, epoch, number, recovery). Few
  /// keyframes and fast motion were checked when the update began to be applied.
  std::optional<std::string_view> obsolete_reason(Worker& worker,
                                                  const UpdateArrival& arrival) const;
  void record_declined(const UpdateArrival& arrival, std::string_view reason);

  // Tracking's: call these on the tracking worker.
  /// Copies the tracking state that the rules need. Call between two frames.
  void look();
  /// Enters the keyframe poses of a declined update if they are newer than those known: the edge
  /// may be gone before it sends them again.
  void keep_poses(Worker& worker, const UpdateArrival& arrival);
  void place_keyframes(const wire::MapUpdate& update);
  /// A keyframe was added to the local map.
  void keyframe_created(RunTime when);
  /// The update has become the local map. newer: with carried-over keyframes that it lacks.
  void applied(const UpdateArrival& arrival, bool newer);
  /// A keyframe of the edge's map was added to the local map; counts as an update with this number.
  void joined(const MapDelta& keyframe, std::uint64_t update, std::uint64_t session);
  void begin_epoch(std::uint64_t epoch);
  void expect_keyframe(KeyFrameId keyframe);
  /// Declines updates that the edge sent before this time from now on.
  void recovered(RunTime when);
  std::uint64_t applied_update() const;
  MapPointId newest_edge_point() const;
  KeyFrameId newest_past_probation() const;

 private:
  /// Returns whether the last applied update came from this edge process.
  bool knows(const PeerState& edge) const { return edge.session == applied_session_; }
  UpdateState state_for(Worker& worker, const UpdateArrival& arrival) const;
  int keyframes_since(RunTime begin) const;
  void note_edge_points(const MapDelta& map);

  MobileNode& node_;
  UpdateRules rules_;

  mutable std::mutex mutex_;  ///< guards what follows
  bool lost_ = false;
  std::weak_ptr<Map> local_map_;  ///< weak: whoever replaces the map must be the one to free it
  std::uint64_t applied_ = 0;
  std::uint64_t applied_session_ = 0;  ///< of the edge process that numbered it
  MapPointId newest_edge_point_;
  KeyFrameId newest_past_probation_{};
  KeyFrameId expected_{};  ///< updates older than this lack deferred keyframes
  RunTime recovered_ = RunTime::min();
  std::uint64_t epoch_ = 0;
  bool new_keyframe_ = false;
  RunTime last_keyframe_{};
  std::deque<RunTime> recent_keyframes_;  ///< creation times within kRateWindow of the last one
};

}  // namespace slambed
