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

/// Counts old keyframes newer than the update and not in `kept` (ascending); tracking loses them.
int local_map_gap(const Map& old_map, KeyFrameId newest, std::span<const KeyFrameId> kept);

/// Brings updates into the tracker. The derived class decides which worker does which step.
class UpdateApplier {
 public:
  /// Called with each applied update and the map built from it.
  using Applied = std::function<void(const wire::MapUpdate&, const std::shared_ptr<Map>&)>;

  UpdateApplier(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check)
      : node_(node), receiver_(receiver), check_(check) {}
  virtual ~UpdateApplier() = default;
  virtual void start() {}
  void on_applied(Applied applied) { on_applied_ = std::move(applied); }

  // Call these on the tracking worker.
  /// Runs between two frames and may replace the local map.
  virtual void before_frame(Worker& worker) = 0;
  /// A keyframe was added to the local map. provisional: it must not become a reference keyframe
  /// until the edge has accepted it.
  virtual void keyframe_created(KeyFrameId, bool /*provisional*/) {}
  /// While suspended, no update is applied.
  virtual void suspend(bool /*suspended*/) {}
  /// Tracking was lost and continues at this keyframe.
  virtual void recovered(RunTime, KeyFrameId) {}
  /// Returns whether the last update was a map for relocalization, and resets the answer to false.
  bool came_from_map() { return std::exchange(from_map_, false); }

 protected:
  struct Outcome {
    RunTime begin;      ///< when tracking stopped for the update
    int gap = 0;        ///< local_map_gap()
    int backed_up = 0;  ///< keyframes not in the update that were carried over
  };
  /// Tells the rules, the system, the pose book and the event log that the update has become the
  /// local map. Call on the tracking worker.
  void done(Worker& worker, const UpdateArrival& arrival, const Outcome& outcome);

  MobileNode& node_;
  UpdateReceiver& receiver_;
  UpdateCheck& check_;

 private:
  Applied on_applied_;
  bool from_map_ = false;
};

/// Makes the applier that a system has chosen. All arguments must outlive it.
using UpdateApplierMaker =
    std::function<std::unique_ptr<UpdateApplier>(MobileNode&, UpdateReceiver&, UpdateCheck&)>;

/// Parses, builds the new map and frees the old one on the tracking worker, as Edge-SLAM does.
class SerialUpdates : public UpdateApplier {
 public:
  using UpdateApplier::UpdateApplier;
  void before_frame(Worker& worker) override;

 protected:
  /// Keyframes of the local map that were carried over into the update's map.
  struct Carried {
    int keyframes = 0;
    std::vector<KeyFrameId> provisional{};  ///< the edge may still decline them; ascending
  };
  /// Returns why an update that passes the rules is declined anyway, or nothing.
  virtual std::optional<std::string_view> additional_decline_reason(const UpdateArrival&) const {
    return std::nullopt;
  }
  /// Copies parts of the local map that the update's map lacks into it.
  virtual Carried carry_over(Worker&, const UpdateArrival&) { return {}; }
  /// The update has become the local map.
  virtual void applied(const UpdateArrival&) {}
};

/// A separate worker parses updates, builds maps and frees old ones; tracking only checks an update
/// and swaps the maps.
class ParallelUpdates final : public UpdateApplier {
 public:
  /// waits: tracking pauses between two frames while the worker processes an update.
  ParallelUpdates(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check, bool waits);
  void start() override;
  void before_frame(Worker& worker) override;

 private:
  void work(Worker& worker);

  bool waits_;
  std::atomic<bool> working_{false};       ///< the worker is processing an update
  Mailbox<UpdateArrival> ready_;           ///< built by the worker
  Mailbox<UpdateArrival> replaced_;        ///< replaced by a newer one before tracking took it
  Mailbox<std::shared_ptr<Map>> disused_;  ///< old maps for the worker to free
};

}  // namespace slambed
