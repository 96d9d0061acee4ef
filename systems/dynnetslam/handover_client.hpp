// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include "node/mobile_node.hpp"
#include "wire/handover_messages.hpp"

namespace slambed {

/// Hands the mobile's map over to the edge, as changes if the edge has an earlier state of it. The
/// map is sent once, however slow the link is: TCP delivers it, so only a new connection or another
/// edge is a reason to send again. The other side is HandoverServer.
class HandoverClient {
 public:
  HandoverClient(MobileNode& node, Channel& channel) : node_(node), channel_(channel) {}

  // Called by tracking.
  /// Sends the edge what it lacks of this map, and lets it map again. edge_is_empty: the edge has
  /// lost its map.
  void begin(std::uint64_t epoch, std::shared_ptr<Map> map, bool edge_is_empty);
  /// Stops mapping on the edge and abandons an unfinished hand-over.
  void stop(std::uint64_t epoch);
  /// The edge has sent this map. Live, copying it is part of the pause for the update. In virtual
  /// time it is free, because a separate stage would be one more cost to fit for each device.
  void received(std::shared_ptr<const Map> map);
  /// True from begin() until the edge has accepted the map.
  bool under_way() const { return under_way_; }

  // Called by the worker that listens to the channel.
  void send_if_due(Worker& worker);
  /// edge: session of the process that answered.
  void acknowledged(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now);

 private:
  /// The state of a map that an edge is known to have.
  struct AcknowledgedMap {
    std::shared_ptr<const Map> map;
    std::shared_ptr<const MapDelta> content;
    std::uint64_t edge = 0;  ///< session of that edge
  };
  struct Handover {
    std::uint64_t epoch = 0, number = 0;
    AcknowledgedMap acknowledged;  ///< becomes acknowledged_ when accepted
    RunTime asked{};
    bool sent = false;  ///< and not yet answered
    bool whole = false;
    RunTime not_before = RunTime::min();
    bool superseded = false;       ///< the edge has sent another map since
    std::uint64_t connection = 0;  ///< on which it was sent last
    wire::MessageType type = wire::MapHandover::kType;
    Bytes payload;  ///< kept because a broken connection may have lost it
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
