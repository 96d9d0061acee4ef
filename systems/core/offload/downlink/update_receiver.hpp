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
  Message raw;  ///< its payload is freed once parsed
  wire::MapUpdate update;
  std::shared_ptr<Map> map;  ///< built from the update; null: not yet

  /// RELOC_MAP rather than MAP_UPDATE.
  bool relocalization() const;
};

/// Receives map updates on the mobile. Any worker may call it.
class UpdateReceiver {
 public:
  UpdateReceiver(MobileNode& node, Channel& channel, MessageCodec codec)
      : node_(node), channel_(channel), codec_(std::move(codec)) {}

  Signal& signal() { return channel_.signal(); }
  /// Returns the next received update, not yet parsed, or nothing.
  std::optional<Message> take();
  /// Parses the message in the codec's stage; reports an invalid one and returns nothing.
  std::optional<UpdateArrival> read(Worker& worker, Message message);

 private:
  MobileNode& node_;
  Channel& channel_;
  MessageCodec codec_;
};

}  // namespace slambed
