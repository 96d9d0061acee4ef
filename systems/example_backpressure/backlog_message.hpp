// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "wire/byte_io.hpp"
#include "wire/message_type.hpp"

namespace slambed::example_backpressure {

/// This system's own messages, from the first free number.
inline constexpr wire::MessageRange kMessages(128, {"BACKLOG"});

/// BACKLOG, edge -> mobile: how many keyframes the edge has not mapped yet. Sent on changes.
struct BacklogMessage {
  static constexpr wire::MessageType kType = kMessages["BACKLOG"];
  std::uint32_t keyframes = 0;
};

inline wire::Bytes encode(const BacklogMessage& message) {
  wire::ByteWriter out;
  out.u32(message.keyframes);
  return out.take();
}

/// Throws DecodeError.
inline BacklogMessage decode_backlog(std::span<const std::uint8_t> bytes) {
  wire::ByteReader in(bytes);
  const BacklogMessage message{.keyframes = in.u32()};
  in.expect_end();
  return message;
}

}  // namespace slambed::example_backpressure
