// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "offload/downlink/update_applier.hpp"

namespace slambed {

struct DownlinkOptions {
  UpdateRules rules;
  MessageCodec codec;
  UpdateApplierMaker applier;
};

/// Brings map updates into the mobile's tracker: the received map replaces the local one between
/// two frames. UpdateReceiver receives an update, UpdateCheck checks it against the rules, and
/// UpdateApplier applies it.
class MapDownlink {
 public:
  MapDownlink(MobileNode& node, Channel& channel, DownlinkOptions options);

  void start() { applier_->start(); }
  /// Call on the tracking worker, between two frames.
  void before_frame(Worker& worker);
  /// Call on the tracking worker when these keyframes were added to the local map. provisional:
  /// they must not become reference keyframes until the edge has accepted them.
  void keyframe_created(RunTime when, const MapDelta& made, bool provisional);
  /// While suspended (tracking is lost and the mobile asks the edge for a pose), no update is
  /// applied. Updates that arrive are checked when tracking continues. Call on the tracking worker.
  void suspend(bool suspended) { applier_->suspend(suspended); }
  /// Tracking was lost and continues at this local keyframe. Call on the tracking worker.
  void recovered(RunTime when, KeyFrameId reference) { applier_->recovered(when, reference); }
  /// Adds a keyframe of the edge's map with all its points to the local map, or replaces the local
  /// map with it. Counts as an update with this number. Call on the tracking worker.
  void join(const MapDelta& keyframe, std::uint64_t update, std::uint64_t session,
            bool takes_its_place);
  /// Returns whether the last update was a map for relocalization, and resets the answer to false.
  bool came_from_map() { return applier_->came_from_map(); }
  /// Number of the last update applied from the current edge process; 0: none.
  std::uint64_t applied_update() const { return check_.applied_update(); }
  /// Newest point made by an edge mapper among all applied updates; none before the first.
  MapPointId newest_edge_point() const { return check_.newest_edge_point(); }
  /// The current edge's last MapUpdate::newest_past_probation; none before the first update.
  KeyFrameId newest_past_probation() const { return check_.newest_past_probation(); }
  /// Declines updates of an older epoch from now on and forgets the number of the last applied
  /// update. Call on the tracking worker.
  void begin_epoch(std::uint64_t epoch) { check_.begin_epoch(epoch); }
  /// Declines updates whose newest keyframe is older than this one from now on: it was sent late,
  /// and the camera has left the place where they end. Call on the tracking worker.
  void expect_keyframe(KeyFrameId keyframe) { check_.expect_keyframe(keyframe); }
  /// The callback runs on the tracking worker with each applied update and the map built from it.
  void on_applied(UpdateApplier::Applied applied) { applier_->on_applied(std::move(applied)); }

 private:
  MobileNode& node_;
  UpdateReceiver receiver_;
  UpdateCheck check_;
  std::unique_ptr<UpdateApplier> applier_;
};

}  // namespace slambed
