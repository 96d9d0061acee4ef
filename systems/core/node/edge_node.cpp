// SPDX-License-Identifier: Apache-2.0
#include "node/edge_node.hpp"

#include "wire/message_type.hpp"

namespace slambed {

Greeting make_greeting(NodeRole role, const std::string& run_key, const std::string& system,
                       std::optional<wire::SensorInfo> sensor, PeerInfo& peer) {
  const wire::Hello ours{.wire_version = wire::kWireVersion,
                         .role = role,
                         .channel = {},
                         .run_key = run_key,
                         .system = system,
                         .sensor = sensor};
  const auto on_channel = [ours](const std::string& channel) {
    wire::Hello hello = ours;
    hello.channel = channel;
    return hello;
  };
  return {.own = [on_channel](const std::string& channel) { return encode(on_channel(channel)); },
          .check = [on_channel, &peer](
                       const std::string& channel,
                       std::span<const std::uint8_t> payload) -> std::optional<std::string> {
            try {
              const wire::Hello theirs = wire::decode_hello(payload);
              if (auto reason = mismatch(on_channel(channel), theirs)) return reason;
              if (theirs.sensor) peer.set(*theirs.sensor);
              return std::nullopt;
            } catch (const wire::DecodeError& error) {
              return error.what();
            }
          }};
}

EdgeNode::EdgeNode(EdgeParts parts, const System& system, const Parameters& parameters)
    : parts_(parts) {
  policy_ = system.edge(*this, parameters);
}

EdgeNode::~EdgeNode() = default;

void EdgeNode::start() { policy_->start(); }

std::string EdgeNode::end_reason() const {
  std::lock_guard lock(mutex_);
  return end_reason_;
}

void EdgeNode::end(const std::string& reason) {
  {
    std::lock_guard lock(mutex_);
    end_reason_ = reason;
  }
  parts_.runtime.stop();
}

}  // namespace slambed
