// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "base/ids.hpp"
#include "offload/downlink/update_check.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

/// Keyframes of the old map that are newer than the update and not among those kept (ascending):
/// lost to tracking.
int local_map_gap(const Map& old_map, KeyFrameId newest, std::span<const KeyFrameId> kept);

/// Applies updates: brings them into the tracker, and what follows then. Which worker does what is
/// the derived class's.
class UpdateApplier {
 public:
  /// Called with each update and the map it has become.
  using Applied = std::function<void(const wire::MapUpdate&, const std::shared_ptr<Map>&)>;

  UpdateApplier(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check)
      : node_(node), receiver_(receiver), check_(check) {}
  virtual ~UpdateApplier() = default;
  virtual void start() {}
  void on_applied(Applied applied) { on_applied_ = std::move(applied); }

  // On the tracking worker.
  /// Between two frames: the place where the local map may be replaced.
  virtual void before_frame(Worker& worker) = 0;
  /// A keyframe was added to the local map. provisional: it is no reference until the edge has
  /// accepted it.
  virtual void keyframe_created(KeyFrameId, bool /*provisional*/) {}
  /// No update is applied until it is called again.
  virtual void suspend(bool /*suspended*/) {}
  /// Tracking was lost and goes on, found at this keyframe.
  virtual void recovered(RunTime, KeyFrameId) {}
  /// Whether the last update was a map for relocalization; not any more once asked.
  bool came_from_map() { return std::exchange(from_map_, false); }

 protected:
  struct Outcome {
    RunTime begin;      ///< since when tracking stood still for it
    int gap = 0;        ///< local_map_gap()
    int backed_up = 0;  ///< keyframes not in the update that were carried over
  };
  /// When the update has become the local map: the rules hear of it, the system, the pose book and
  /// the event log. On the tracking worker.
  void done(Worker& worker, const UpdateArrival& arrival, const Outcome& outcome);

  MobileNode& node_;
  UpdateReceiver& receiver_;
  UpdateCheck& check_;

 private:
  Applied on_applied_;
  bool from_map_ = false;
};

/// Makes the applier that a system has chosen; all that it is given outlives it.
using UpdateApplierMaker =
    std::function<std::unique_ptr<UpdateApplier>(MobileNode&, UpdateReceiver&, UpdateCheck&)>;

/// Everything (parsing, building the new map, disposing of the old one) on the tracking worker, as
/// in Edge-SLAM.
class SerialUpdates : public UpdateApplier {
 public:
  using UpdateApplier::UpdateApplier;
  void before_frame(Worker& worker) override;

 protected:
  /// Keyframes of the local map that go on in the update's.
  struct Carried {
    int keyframes = 0;
    std::vector<KeyFrameId> provisional{};  ///< the edge may still decline them; ascending
  };
  /// Why an update that the rules welcome is declined all the same, or nothing.
  virtual std::optional<std::string_view> additional_decline_reason(const UpdateArrival&) const {
    return std::nullopt;
  }
  /// Adds to the update's map what it lacks of the local one.
  virtual Carried carry_over(Worker&, const UpdateArrival&) { return {}; }
  /// The update has become the local map.
  virtual void applied(const UpdateArrival&) {}
};

/// A worker parses and builds; tracking checks and swaps; the worker disposes of the old map.
class ParallelUpdates final : public UpdateApplier {
 public:
  /// waits: between two frames tracking stands still while the worker is at an update.
  ParallelUpdates(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check, bool waits);
  void start() override;
  void before_frame(Worker& worker) override;

 private:
  void work(Worker& worker);

  bool waits_;
  std::atomic<bool> working_{false};       ///< the worker is at an update
  Mailbox<UpdateArrival> ready_;           ///< built by the worker
  Mailbox<UpdateArrival> replaced_;        ///< by a newer one, before tracking looked
  Mailbox<std::shared_ptr<Map>> disused_;  ///< to be disposed of by the worker
};

}  // namespace slambed
