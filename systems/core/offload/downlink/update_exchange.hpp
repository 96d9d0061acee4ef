// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <utility>

#include "offload/downlink/update_inbox.hpp"

namespace slambed {

/// Keyframes of the old map that are newer than the update and not among those kept (ascending):
/// lost to tracking.
int local_map_gap(const Map& old_map, KeyFrameId newest, std::span<const KeyFrameId> kept);

/// What follows when an update has become the local map, however it came there: the rules hear of
/// it, the system, the pose book and the event log. On the tracking worker.
class UpdateExchange {
 public:
  /// Called with each update and the map it has become.
  using Applied = std::function<void(const wire::MapUpdate&, const std::shared_ptr<Map>&)>;

  UpdateExchange(MobileNode& node, UpdateInbox& inbox) : node_(node), inbox_(inbox) {}
  void on_applied(Applied applied) { on_applied_ = std::move(applied); }

  struct Outcome {
    RunTime begin;      ///< since when tracking stood still for it
    int gap = 0;        ///< local_map_gap()
    int backed_up = 0;  ///< keyframes not in the update that were carried over
  };
  /// Whether the last update was a map for relocalisation; not any more once asked.
  bool came_from_map() { return std::exchange(from_map_, false); }
  void done(Worker& worker, const UpdateArrival& arrival, const Outcome& outcome);

 private:
  MobileNode& node_;
  UpdateInbox& inbox_;
  Applied on_applied_;
  bool from_map_ = false;
};

}  // namespace slambed
