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

/// One framed message, with a payload that the wire layer encodes. type: wire::MessageType.
struct Message {
  std::uint8_t type = 0;
  std::uint64_t sequence = 0;  ///< per channel and direction, from 1
  RunTime queued{};            ///< on the sender's run clock
  RunTime sent{};              ///< first byte handed to the transport
  RunTime received{};          ///< last byte received from the transport
  std::uint64_t session = 0;   ///< of the peer that sent it (PeerState)
  Bytes payload;
};

/// What the transport knows about the path; absent while unknown.
struct PathStats {
  std::optional<Duration> smoothed_rtt;  ///< tcpi_rtt, or its model
  /// Live: bytes in the send queue and in the kernel's send buffer (SIOCOUTQ). In virtual time:
  /// bytes that TCP has sent and the peer has not acknowledged, without the send queue and without
  /// what the congestion window holds back. The codec `compatibility` adds what it still holds.
  std::uint64_t unacknowledged_bytes = 0;
  bool connected = false;
  std::uint64_t connections = 0;  ///< number of connections so far, including this one
};

struct ChannelOptions {
  std::string name;    ///< "keyframe", "map", "frame"
  int send_queue = 0;  ///< limit of messages to be sent, 0: unbounded; when full, drops the oldest
  int receive_queue = 0;  ///< the same for messages received but not yet taken
  std::size_t max_payload = 64u << 20;
  bool heartbeat = false;  ///< both nodes send heartbeats here while they send nothing else
};

/// A bidirectional, ordered message connection to the peer node. Sending never blocks the caller.
/// The loss of the peer is recorded, and the channel reconnects automatically.
class Channel {
 public:
  virtual ~Channel() = default;
  virtual const ChannelOptions& options() const = 0;
  /// Returns the message's sequence.
  virtual std::uint64_t send(std::uint8_t type, Bytes payload) = 0;
  /// While held, no queued message is sent; a transfer in progress continues.
  virtual void hold(bool held) = 0;
  virtual std::optional<Message> try_receive() = 0;
  /// Notified on arrival, connect and disconnect.
  virtual Signal& signal() = 0;
  virtual PathStats path() const = 0;

  /// Blocks the worker until a message arrives, the deadline passes or the run stops.
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
