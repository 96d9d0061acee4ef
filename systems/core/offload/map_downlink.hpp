// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "node/mobile_node.hpp"
#include "offload/message_codec.hpp"
#include "offload/update_rules.hpp"
#include "runtime/mailbox.hpp"
#include "wire/messages.hpp"

namespace slambed {

/// Takes map updates over on the mobile: the received map replaces the local one between two
/// frames.
///
/// serial: everything (parsing, building the new map, disposing of the old one) happens on the
/// tracking worker, as in Edge-SLAM. parallel: a worker parses and builds; tracking only swaps, and
/// the worker disposes of the old map.
class MapDownlink {
 public:
  enum class Mode { kSerial, kParallel };

  MapDownlink(MobileNode& node, Channel& channel, Mode mode, UpdateRules rules,
              MessageCodec codec = {});

  void start();
  /// On the tracking worker, between two frames.
  void before_frame(Worker& worker);
  /// On the tracking worker: a keyframe was added to the local map.
  void keyframe_created(RunTime when);
  /// Number of the last update taken over from the edge that is there now; 0: none.
  std::uint64_t applied_update() const { return knows(node_.network().peer()) ? applied_ : 0; }
  /// Newest point of an edge mapper among all updates taken over; none before the first.
  MapPointId newest_edge_point() const { return newest_edge_point_; }
  /// What its last update said of points that need no more counting; none before the first.
  KeyFrameId settled() const { return knows(node_.network().peer()) ? settled_ : KeyFrameId{}; }
  /// Updates of an older epoch are declined from now on; they are counted anew. On the tracking
  /// worker.
  void begin_epoch(std::uint64_t epoch) {
    epoch_ = epoch;
    applied_ = 0;
  }
  /// Updates that show the map before this keyframe are declined from now on: it was sent late, and
  /// where they end the camera is no more. On the tracking worker.
  void expect_keyframe(KeyFrameId keyframe) { expected_ = keyframe; }
  /// Called on the tracking worker with each update and the map it has become.
  using Applied = std::function<void(const wire::MapUpdate&, const std::shared_ptr<Map>&)>;
  void on_applied(Applied applied) { on_applied_ = std::move(applied); }

 private:
  /// An update on its way into the tracker.
  struct Arrival {
    Message raw;
    wire::MapUpdate update;
    std::shared_ptr<Map> map;
  };

  /// The last update came from this edge, not from one before it.
  bool knows(const PeerState& edge) const { return edge.incarnation == applied_incarnation_; }
  void work(Worker& worker);
  bool parse(Worker& worker, Arrival& arrival);
  void build(Arrival& arrival);
  /// True, and recorded, when the update is not taken over. What it tells of poses is kept if new.
  bool declined(Worker& worker, const Arrival& arrival);
  UpdateState state_for(Worker& worker, const Arrival& arrival) const;
  void place_keyframes(const wire::MapUpdate& update);
  int keyframes_since(RunTime begin) const;
  /// begin: since when tracking stands still for it.
  void apply(Worker& worker, Arrival arrival, RunTime begin);
  void record_declined(std::uint64_t update, KeyFrameId newest, std::string_view reason);
  void record_received(const Arrival& arrival);

  MobileNode& node_;
  Channel& channel_;
  Mode mode_;
  UpdateRules rules_;
  MessageCodec codec_;
  Applied on_applied_;
  Mailbox<Arrival> ready_;                 ///< parallel: built by the worker
  Mailbox<Arrival> replaced_;              ///< parallel: by a newer one, before tracking looked
  Mailbox<std::shared_ptr<Map>> disused_;  ///< parallel: to be disposed of by the worker

  // The tracking worker's.
  std::uint64_t applied_ = 0;
  std::uint64_t applied_incarnation_ = 0;  ///< of the edge it came from: each counts its own
  MapPointId newest_edge_point_;
  KeyFrameId settled_{};
  KeyFrameId expected_{};  ///< older ones than this are behind
  std::uint64_t epoch_ = 0;
  std::size_t keyframes_created_ = 0;
  bool new_keyframe_ = false;
  RunTime last_keyframe_{};
  std::deque<RunTime> recent_keyframes_;  ///< created within kRateWindow of the last one
};

}  // namespace slambed
