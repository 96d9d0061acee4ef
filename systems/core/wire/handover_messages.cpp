// SPDX-License-Identifier: Apache-2.0
#include "wire/handover_messages.hpp"

#include "wire/delta_codec.hpp"

namespace slambed::wire {

Bytes encode(const StateMessage& message) {
  ByteWriter out;
  out.u8(message.state);
  out.varint(message.epoch);
  out.time(message.time);
  out.u8(message.rtt.has_value());
  if (message.rtt) out.time(*message.rtt);
  return out.take();
}

StateMessage decode_state(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  StateMessage message;
  message.state = in.u8();
  message.epoch = in.varint();
  message.time = in.time();
  if (in.flag()) {
    message.rtt = in.time();
    if (*message.rtt < Duration::zero()) throw DecodeError("STATE holds a negative RTT");
  }
  in.expect_end();
  return message;
}

Bytes encode(const StopMessage& message) {
  ByteWriter out;
  out.varint(message.epoch);
  return out.take();
}

StopMessage decode_stop(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  const StopMessage message{in.varint()};
  in.expect_end();
  return message;
}

Bytes encode(const StartMessage& message) {
  ByteWriter out;
  out.varint(message.epoch);
  out.varint(message.number);
  return out.take();
}

StartMessage decode_start(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  StartMessage message;
  message.epoch = in.varint();
  message.number = in.varint();
  in.expect_end();
  return message;
}

Bytes encode(const MapHandover& message) {
  ByteWriter out;
  out.varint(message.epoch);
  out.varint(message.number);
  out.u8(message.whole);
  put_delta(out, message.changes);
  return out.take();
}

MapHandover decode_handover(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  ByteReader in(bytes);
  MapHandover message;
  message.epoch = in.varint();
  message.number = in.varint();
  message.whole = in.flag();
  message.changes = get_delta(in, sensor);
  in.expect_end();
  if (message.whole && message.changes.keyframes.empty()) {
    throw DecodeError("MAP_HANDOVER of a whole map holds no keyframe");
  }
  return message;
}

std::optional<StartMessage> handover_head(std::span<const std::uint8_t> bytes) {
  try {
    ByteReader in(bytes);
    StartMessage head;
    head.epoch = in.varint();
    head.number = in.varint();
    return head;
  } catch (const DecodeError&) {
    return std::nullopt;
  }
}

Bytes encode(const HandoverAck& message) {
  ByteWriter out;
  out.varint(message.epoch);
  out.varint(message.number);
  out.u8(static_cast<std::uint8_t>(message.answer));
  return out.take();
}

HandoverAck decode_handover_ack(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  HandoverAck message;
  message.epoch = in.varint();
  message.number = in.varint();
  const std::uint8_t answer = in.u8();
  if (answer > static_cast<std::uint8_t>(HandoverAnswer::kNoMap))
    throw DecodeError("HANDOVER_ACK holds an unknown answer");
  message.answer = static_cast<HandoverAnswer>(answer);
  in.expect_end();
  return message;
}

}  // namespace slambed::wire
