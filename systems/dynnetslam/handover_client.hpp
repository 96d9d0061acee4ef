// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include "node/mobile_node.hpp"
#include "wire/handover_messages.hpp"

namespace slambed {

/// Hands the mobile's map over to the edge, by what has changed where the edge knows an earlier
/// state of it, once however slow the link is: TCP delivers, so only a new connection or another
/// edge is a reason to send again. The other side is HandoverServer.
class HandoverClient {
 public:
  HandoverClient(MobileNode& node, Channel& channel) : node_(node), channel_(channel) {}

  // Tracking's calls.
  /// The edge gets what this map has that it does not know of, and maps again. edge_is_empty: it
  /// knows nothing any more.
  void begin(std::uint64_t epoch, std::shared_ptr<Map> map, bool edge_is_empty);
  /// Mapping on the edge ends, a hand-over under way is worth nothing any more.
  void stop(std::uint64_t epoch);
  /// The edge has sent this map. Live, copying it is a part of the pause for the update; in virtual
  /// time it is free: a stage of its own would be one more cost to fit for each device.
  void received(std::shared_ptr<const Map> map);
  /// True from begin() until the edge has taken the map over.
  bool under_way() const { return under_way_; }

  // Calls of the worker that listens to the channel.
  void send_if_due(Worker& worker);
  /// edge: the process that answered.
  void acknowledged(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now);

 private:
  /// What an edge knows of a map: that map as it was then.
  struct AcknowledgedMap {
    std::shared_ptr<const Map> map;
    std::shared_ptr<const MapDelta> content;
    std::uint64_t edge = 0;  ///< session of the edge that knows
  };
  struct Handover {
    std::uint64_t epoch = 0, number = 0;
    AcknowledgedMap acknowledged;  ///< once it is acknowledged
    RunTime asked{};
    bool sent = false;  ///< and not answered
    bool whole = false;
    RunTime not_before = RunTime::min();
    bool superseded = false;       ///< the edge has sent another map since
    std::uint64_t connection = 0;  ///< on which it was sent last
    wire::MessageType type = wire::MapHandover::kType;
    Bytes payload;  ///< as it was sent: a broken connection may have lost it
  };

  void prepare(Worker& worker, Handover handover, AcknowledgedMap base);
  void send(Handover& handover);

  MobileNode& node_;
  Channel& channel_;
  std::atomic<bool> under_way_{false};

  std::mutex mutex_;  ///< guards what follows
  AcknowledgedMap acknowledged_;
  std::shared_ptr<Map> map_;  ///< to be handed over
  Handover handover_;
  std::uint64_t handovers_ = 0;
};

}  // namespace slambed
