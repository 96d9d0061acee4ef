// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "base/ids.hpp"
#include "offload/downlink/update_exchange.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

/// The way of an update from the inbox into the tracker, and on which worker each step is done.
class UpdatePath {
 public:
  virtual ~UpdatePath() = default;
  virtual void start() {}
  /// On the tracking worker, between two frames: the place where the local map may be replaced.
  virtual void before_frame(Worker& worker) = 0;
  /// On the tracking worker: a keyframe was added to the local map. provisional: it is no reference
  /// until the edge has accepted it.
  virtual void keyframe_created(KeyFrameId, bool /*provisional*/) {}
  /// On the tracking worker: no update is applied until it is called again.
  virtual void suspend(bool /*suspended*/) {}
  /// On the tracking worker: tracking was lost and goes on, found at this keyframe.
  virtual void recovered(RunTime, KeyFrameId) {}
};

/// Makes the way that a system has chosen; all that it is given outlives it.
using UpdatePathMaker =
    std::function<std::unique_ptr<UpdatePath>(MobileNode&, UpdateInbox&, UpdateExchange&)>;

/// Everything (parsing, building the new map, disposing of the old one) on the tracking worker, as
/// in Edge-SLAM.
class SerialUpdates : public UpdatePath {
 public:
  SerialUpdates(MobileNode& node, UpdateInbox& inbox, UpdateExchange& exchange)
      : node_(node), inbox_(inbox), exchange_(exchange) {}
  void before_frame(Worker& worker) override;

 protected:
  /// Keyframes of the local map that go on in the update's.
  struct Carried {
    int keyframes = 0;
    std::vector<KeyFrameId> provisional{};  ///< the edge may still decline them; ascending
  };
  /// Why an update that the rules welcome is declined all the same, or nothing.
  virtual std::optional<std::string_view> further_reason(const UpdateArrival&) const {
    return std::nullopt;
  }
  /// Adds to the update's map what it lacks of the local one.
  virtual Carried carry_over(Worker&, const UpdateArrival&) { return {}; }
  /// The update has become the local map.
  virtual void applied(const UpdateArrival&) {}

  MobileNode& node_;
  UpdateInbox& inbox_;

 private:
  UpdateExchange& exchange_;
};

/// A worker parses and builds; tracking judges and swaps; the worker disposes of the old map.
class ParallelUpdates final : public UpdatePath {
 public:
  /// waits: between two frames tracking stands still while the worker is at an update.
  ParallelUpdates(MobileNode& node, UpdateInbox& inbox, UpdateExchange& exchange, bool waits);
  void start() override;
  void before_frame(Worker& worker) override;

 private:
  void work(Worker& worker);

  MobileNode& node_;
  UpdateInbox& inbox_;
  UpdateExchange& exchange_;
  bool waits_;
  std::atomic<bool> working_{false};       ///< the worker is at an update
  Mailbox<UpdateArrival> ready_;           ///< built by the worker
  Mailbox<UpdateArrival> replaced_;        ///< by a newer one, before tracking looked
  Mailbox<std::shared_ptr<Map>> disused_;  ///< to be disposed of by the worker
};

}  // namespace slambed
