// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>

#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "offload/downlink/update_rules.hpp"
#include "wire/messages.hpp"

namespace slambed {

/// An update on its way into the tracker.
struct UpdateArrival {
  Message raw;  ///< without its payload once that was read
  wire::MapUpdate update;
  std::shared_ptr<Map> map;  ///< made of it; null: not yet

  /// RELOC_MAP rather than MAP_UPDATE.
  bool relocalisation() const;
};

/// Map updates as they come to the mobile: read, judged by the rules, and what is known of the last
/// one that was applied. A worker of its own may receive and judge while tracking goes on; what
/// is not marked as tracking's may be called from any worker.
class UpdateInbox {
 public:
  UpdateInbox(MobileNode& node, Channel& channel, UpdateRules rules, MessageCodec codec);

  Signal& signal() { return channel_.signal(); }
  /// The next update that came, unread; nothing: none did.
  std::optional<Message> take();
  /// Reads it, in the stage of the codec; nothing, and a warning, when that is impossible.
  std::optional<UpdateArrival> read(Worker& worker, Message message);

  /// Why the rules decline it.
  std::optional<std::string_view> decline_reason(Worker& worker,
                                                 const UpdateArrival& arrival) const;
  /// The same without what only mattered when it began to be worked in.
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
  void joined(const MapDelta& keyframe, std::uint64_t update, std::uint64_t incarnation);
  void begin_epoch(std::uint64_t epoch);
  void expect_keyframe(KeyFrameId keyframe);
  /// Updates that left before this are declined from now on.
  void recovered(RunTime when);
  std::uint64_t applied_update() const;
  MapPointId newest_edge_point() const;
  KeyFrameId past_probation() const;

 private:
  /// The last update came from this edge, not from one before it.
  bool knows(const PeerState& edge) const { return edge.incarnation == applied_incarnation_; }
  UpdateState state_for(Worker& worker, const UpdateArrival& arrival) const;
  int keyframes_since(RunTime begin) const;
  void note_edge_points(const MapDelta& map);

  MobileNode& node_;
  Channel& channel_;
  UpdateRules rules_;
  MessageCodec codec_;

  mutable std::mutex mutex_;  ///< guards what follows
  bool lost_ = false;
  std::weak_ptr<Map> local_map_;  ///< tracking's: who replaces it disposes of it
  std::uint64_t applied_ = 0;
  std::uint64_t applied_incarnation_ = 0;  ///< of the edge it came from: each counts its own
  MapPointId newest_edge_point_;
  KeyFrameId past_probation_{};
  KeyFrameId expected_{};  ///< older ones than this are behind
  RunTime recovered_ = RunTime::min();
  std::uint64_t epoch_ = 0;
  bool new_keyframe_ = false;
  RunTime last_keyframe_{};
  std::deque<RunTime> recent_keyframes_;  ///< created within kRateWindow of the last one
};

}  // namespace slambed
