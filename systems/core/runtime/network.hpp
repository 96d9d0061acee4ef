// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "runtime/channel.hpp"

namespace slambed {

/// What both ends show each other before the first message of every connection. The content is the
/// caller's (wire::Hello); transports only carry it and turn away whoever fails the check.
struct Greeting {
  /// The payload this node shows on the named channel.
  std::function<Bytes(const std::string& channel)> own;
  /// Nothing when the peer is welcome, else the reason to record.
  std::function<std::optional<std::string>(const std::string& channel,
                                           std::span<const std::uint8_t> payload)>
      check;
};

/// A peer of which nothing was heard for so long counts as away, connected or not.
inline constexpr Duration kPeerSilence = std::chrono::seconds(1);

/// What a node knows of the other one.
struct PeerState {
  /// Every channel has its connection, and the peer shows signs of life.
  bool connected = false;
  /// The peer's session: one life of its process, counted from 1; 0: none was met yet. A new number
  /// means that the peer was restarted and the old process is gone with all it knew: its map, its
  /// queues, what was under way.
  std::uint64_t session = 0;

  bool operator==(const PeerState&) const = default;
};

/// The channels between the two nodes of a run. live/ and virtual/ stand side by side. Losing the
/// peer ends nothing: messages wait in their queues and go on when it is back.
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
