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

/// The channels between the two nodes of a run. live/ and virtual/ stand side by side.
class Network {
 public:
  virtual ~Network() = default;
  /// Channels are opened once, before the run starts; the network owns them.
  virtual Channel& open(const ChannelOptions& options) = 0;
};

}  // namespace slambed
