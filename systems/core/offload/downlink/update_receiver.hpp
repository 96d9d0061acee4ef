// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "wire/messages.hpp"

namespace slambed {

/// An update on its way into the tracker.
struct UpdateArrival {
  Message raw;  ///< without its payload once that was read
  wire::MapUpdate update;
  std::shared_ptr<Map> map;  ///< made of it; null: not yet

  /// RELOC_MAP rather than MAP_UPDATE.
  bool relocalization() const;
};

/// Receives map updates on the mobile. From any worker.
class UpdateReceiver {
 public:
  UpdateReceiver(MobileNode& node, Channel& channel, MessageCodec codec)
      : node_(node), channel_(channel), codec_(std::move(codec)) {}

  Signal& signal() { return channel_.signal(); }
  /// The next update that came, unread; nothing: none did.
  std::optional<Message> take();
  /// Reads it, in the stage of the codec; nothing, and a warning, when that is impossible.
  std::optional<UpdateArrival> read(Worker& worker, Message message);

 private:
  MobileNode& node_;
  Channel& channel_;
  MessageCodec codec_;
};

}  // namespace slambed
