// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string_view>

#include "runtime/channel.hpp"
#include "runtime/frame_header.hpp"
#include "runtime/observer.hpp"

namespace slambed {

inline std::size_t size_on_wire(const Message& message) {
  return message.payload.size() + FrameHeader::kSize;
}

/// Returns the record that a channel reports when a message is taken or dropped.
inline MessageRecord record_of(const Message& message, std::string_view channel, bool incoming,
                               bool dropped) {
  return {.channel = channel,
          .incoming = incoming,
          .dropped = dropped,
          .type = message.type,
          .bytes = size_on_wire(message),
          .sequence = message.sequence,
          .queued = message.queued,
          .sent = message.sent,
          .received = message.received};
}

}  // namespace slambed
