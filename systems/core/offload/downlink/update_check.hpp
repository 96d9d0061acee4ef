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

/// Checks by the rules whether a map update is applied, from what is known of tracking, of the edge
/// and of the last update that was applied. A worker of its own may check while tracking goes on;
/// what is not marked as tracking's may be called from any worker.
class UpdateCheck {
 public:
  UpdateCheck(MobileNode& node, UpdateRules rules) : node_(node), rules_(rules) {}

  /// The reason why the rules decline it, or nothing.
  std::optional<std::string_view> update_decline_reason(Worker& worker,
                                                        const UpdateArrival& arrival) const;
  /// Only the reasons for which no map may be made of it at all (edge, epoch, number, recovery);
  /// few keyframes and fast motion were judged when the update began to be applied.
  std::optional<std::string_view> obsolete_reason(Worker& worker,
                                                  const UpdateArrival& arrival) const;
  void record_declined(const UpdateArrival& arrival, std::string_view reason);

  // Tracking's.
  /// Between two frames: what the rules have to know of tracking.
  void look();
  /// Takes over what the update tells of poses, where that is new though its map is not wanted: the
  /// edge may be gone before it tells them again.
  void keep_poses(Worker& worker, const UpdateArrival& arrival);
  void place_keyframes(const wire::MapUpdate& update);
  /// A keyframe was added to the local map.
  void keyframe_created(RunTime when);
  /// The update has become the local map. newer: together with keyframes that it does not cover.
  void applied(const UpdateArrival& arrival, bool newer);
  /// A keyframe of the edge's map has joined the local one as if by an update with this number.
  void joined(const MapDelta& keyframe, std::uint64_t update, std::uint64_t session);
  void begin_epoch(std::uint64_t epoch);
  void expect_keyframe(KeyFrameId keyframe);
  /// Updates that left before this are declined from now on.
  void recovered(RunTime when);
  std::uint64_t applied_update() const;
  MapPointId newest_edge_point() const;
  KeyFrameId newest_past_probation() const;

 private:
  /// The last update came from this edge, not from one before it.
  bool knows(const PeerState& edge) const { return edge.session == applied_session_; }
  UpdateState state_for(Worker& worker, const UpdateArrival& arrival) const;
  int keyframes_since(RunTime begin) const;
  void note_edge_points(const MapDelta& map);

  MobileNode& node_;
  UpdateRules rules_;

  mutable std::mutex mutex_;  ///< guards what follows
  bool lost_ = false;
  std::weak_ptr<Map> local_map_;  ///< tracking's: who replaces it disposes of it
  std::uint64_t applied_ = 0;
  std::uint64_t applied_session_ = 0;  ///< of the edge it came from: each counts its own
  MapPointId newest_edge_point_;
  KeyFrameId newest_past_probation_{};
  KeyFrameId expected_{};  ///< updates older than this lack deferred keyframes
  RunTime recovered_ = RunTime::min();
  std::uint64_t epoch_ = 0;
  bool new_keyframe_ = false;
  RunTime last_keyframe_{};
  std::deque<RunTime> recent_keyframes_;  ///< created within kRateWindow of the last one
};

}  // namespace slambed
