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

/// Takes map updates over on the mobile: the received map replaces the local one between two
/// frames. An update is received (UpdateReceiver), checked by the rules (UpdateCheck) and applied
/// (UpdateApplier).
class MapDownlink {
 public:
  MapDownlink(MobileNode& node, Channel& channel, DownlinkOptions options);

  void start() { applier_->start(); }
  /// On the tracking worker, between two frames.
  void before_frame(Worker& worker);
  /// On the tracking worker: these keyframes were added to the local map; provisional: they are no
  /// references until the edge has accepted them.
  void keyframe_created(RunTime when, const MapDelta& made, bool provisional);
  /// While tracking is lost and the edge is asked for a pose no update is applied; what comes
  /// waits and is checked when tracking goes on. On the tracking worker.
  void suspend(bool suspended) { applier_->suspend(suspended); }
  /// Tracking was lost and goes on, found at this keyframe of the local map. On the tracking
  /// worker.
  void recovered(RunTime when, KeyFrameId reference) { applier_->recovered(when, reference); }
  /// A keyframe of the edge's map with all its points joins the local map, or takes its place;
  /// counts as an update with this number. On the tracking worker.
  void join(const MapDelta& keyframe, std::uint64_t update, std::uint64_t session,
            bool takes_its_place);
  /// Whether the last update was a map for relocalization; not any more once asked.
  bool came_from_map() { return applier_->came_from_map(); }
  /// Number of the last update applied from the edge that is there now; 0: none.
  std::uint64_t applied_update() const { return check_.applied_update(); }
  /// Newest point of an edge mapper among all updates applied; none before the first.
  MapPointId newest_edge_point() const { return check_.newest_edge_point(); }
  /// What its last update said of points that need no more counting; none before the first.
  KeyFrameId newest_past_probation() const { return check_.newest_past_probation(); }
  /// Updates of an older epoch are declined from now on; they are counted anew. On the tracking
  /// worker.
  void begin_epoch(std::uint64_t epoch) { check_.begin_epoch(epoch); }
  /// Updates that show the map before this keyframe are declined from now on: it was sent late, and
  /// where they end the camera is no more. On the tracking worker.
  void expect_keyframe(KeyFrameId keyframe) { check_.expect_keyframe(keyframe); }
  /// Called on the tracking worker with each update and the map it has become.
  void on_applied(UpdateApplier::Applied applied) { applier_->on_applied(std::move(applied)); }

 private:
  MobileNode& node_;
  UpdateReceiver receiver_;
  UpdateCheck check_;
  std::unique_ptr<UpdateApplier> applier_;
};

}  // namespace slambed
