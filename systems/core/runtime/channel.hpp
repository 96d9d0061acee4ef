// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

using Bytes = std::vector<std::uint8_t>;

/// One framed message: what the wire floor encodes and verifies. type: wire::MessageType.
struct Message {
  std::uint8_t type = 0;
  std::uint64_t sequence = 0;  ///< per channel and direction, from 1
  RunTime queued{};            ///< on the sender's run clock
  RunTime sent{};              ///< first byte handed to the transport
  RunTime received{};          ///< last byte taken from it
  std::uint64_t session = 0;   ///< of the peer that sent it (PeerState)
  Bytes payload;
};

/// What the transport knows about the path; absent while unknown.
struct PathStats {
  std::optional<Duration> smoothed_rtt;  ///< tcpi_rtt, or its model
  /// Live: what waits in the send queue and in the kernel's send buffer (SIOCOUTQ). In virtual
  /// time: only what TCP has sent and the peer has not acknowledged, neither the send queue nor
  /// what the congestion window still keeps back. With the codec `compatibility`, its queue of its
  /// own, too.
  std::uint64_t unacknowledged_bytes = 0;
  bool connected = false;
  std::uint64_t connections = 0;  ///< how many there were so far, this one included
};

struct ChannelOptions {
  std::string name;    ///< "keyframe", "map", "frame"
  int send_queue = 0;  ///< backlog to be sent, messages; 0: unbounded. When full, drop the oldest
  int receive_queue = 0;  ///< likewise for messages not yet taken
  std::size_t max_payload = 64u << 20;
  bool heartbeat = false;  ///< both ends show signs of life here when they have nothing to say
};

/// A bidirectional, ordered message connection to the peer node. Sending never blocks the caller;
/// losing the peer is a recorded outcome, the channel reconnects by itself.
class Channel {
 public:
  virtual ~Channel() = default;
  virtual const ChannelOptions& options() const = 0;
  /// Returns the message's sequence.
  virtual std::uint64_t send(std::uint8_t type, Bytes payload) = 0;
  /// While held, no transfer of a waiting message starts; what is under way goes on.
  virtual void hold(bool held) = 0;
  virtual std::optional<Message> try_receive() = 0;
  /// Notified on arrival, connect and disconnect.
  virtual Signal& signal() = 0;
  virtual PathStats path() const = 0;

  /// Blocks the worker until a message, the deadline or the end of the run.
  std::optional<Message> receive(Worker& worker, RunTime deadline) {
    for (;;) {
      const auto ticket = signal().ticket();
      if (auto message = try_receive()) return message;
      if (worker.stopping() || worker.now() >= deadline) return std::nullopt;
      worker.wait(signal(), ticket, deadline);
    }
  }
};

}  // namespace slambed
