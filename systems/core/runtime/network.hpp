// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "runtime/channel.hpp"

namespace slambed {

/// What both nodes exchange before the first message of every connection. The caller defines the
/// content (wire::Hello); transports only carry it and reject a peer that fails the check.
struct Greeting {
  /// Returns the payload that this node sends on the named channel.
  std::function<Bytes(const std::string& channel)> own;
  /// Returns the reason why the peer is rejected, or nothing.
  std::function<std::optional<std::string>(const std::string& channel,
                                           std::span<const std::uint8_t> payload)>
      check;
};

/// A peer that sends nothing for this long counts as disconnected, even if TCP is connected.
inline constexpr Duration kPeerSilence = std::chrono::seconds(1);

/// What a node knows about its peer.
struct PeerState {
  /// Every channel has a connection, and the peer was not silent for kPeerSilence.
  bool connected = false;
  /// Counts the peer's processes from 1; 0: no contact yet. A new number means that the peer was
  /// restarted and has lost its map, its queues and the messages in flight.
  std::uint64_t session = 0;

  bool operator==(const PeerState&) const = default;
};

/// The channels between the two nodes of a run, implemented in live/ and virtual/. While the peer
/// is lost, messages wait in their queues; they are sent when it is back.
class Network {
 public:
  virtual ~Network() = default;
  /// Channels are opened once, before the run starts; the network owns them.
  virtual Channel& open(const ChannelOptions& options) = 0;
  virtual PeerState peer() const = 0;
  /// Notified whenever peer() changes.
  virtual Signal& peer_signal() = 0;
};

}  // namespace slambed
