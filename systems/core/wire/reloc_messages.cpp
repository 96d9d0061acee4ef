// SPDX-License-Identifier: Apache-2.0
#include "wire/reloc_messages.hpp"

#include <set>

#include "wire/compatibility_codec.hpp"
#include "wire/delta_codec.hpp"
#include "wire/id_codec.hpp"

namespace slambed::wire {
namespace {

constexpr std::size_t kLeastMatch = 3;  ///< bytes

Bytes with_body(ByteWriter header, const Bytes& body) {
  Bytes bytes = header.take();
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}

ByteWriter request_header(const RelocRequest& message) {
  ByteWriter out;
  out.varint(message.number);
  out.varint(message.applied_update);
  return out;
}

template <typename DecodeFrame>
RelocRequest get_request(std::span<const std::uint8_t> bytes, DecodeFrame decode) {
  ByteReader in(bytes);
  RelocRequest message;
  message.number = in.varint();
  message.applied_update = in.varint();
  message.frame = decode(in.take(in.remaining()));
  return message;
}

void put_times(ByteWriter& out, const RelocTimes& times) {
  out.time(times.queued);
  out.time(times.received);
}

RelocTimes get_times(ByteReader& in) {
  RelocTimes times;
  times.queued = in.time();
  times.received = in.time();
  return times;
}

ByteWriter ok_header(const RelocOk& message) {
  ByteWriter out;
  out.varint(message.number);
  put_times(out, message.times);
  out.varint(message.update);
  out.u8(message.jumped);
  put_pose(out, message.T_cw);
  out.varint(message.matches.size());
  IdStream ids;
  for (const auto& [feature, point] : message.matches) {
    out.u16(feature);
    ids.put(out, point);
  }
  return out;
}

RelocOk get_ok_header(ByteReader& in) {
  RelocOk message;
  message.number = in.varint();
  message.times = get_times(in);
  message.update = in.varint();
  message.jumped = in.flag();
  message.T_cw = get_pose(in);
  IdStream ids;
  for (std::size_t n = in.count(kLeastMatch); n > 0; --n) {
    const std::uint16_t feature = in.u16();
    message.matches.emplace_back(feature, ids.get<MapPointId>(in));
  }
  return message;
}

void check(const RelocOk& message) {
  if (message.keyframe.keyframes.size() != 1) throw DecodeError("RELOC_OK holds no keyframe");
  std::set<MapPointId> known;
  for (const NewPoint& point : message.keyframe.points) known.insert(point.id);
  for (const auto& [feature, point] : message.matches) {
    if (!known.contains(point)) throw DecodeError("RELOC_OK names a point that it does not hold");
  }
}

}  // namespace

Bytes encode(const RelocRequest& message) {
  return with_body(request_header(message), encode(message.frame));
}

RelocRequest decode_reloc_request(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  return get_request(bytes, [&](auto body) { return decode_frame(body, sensor); });
}

Bytes encode_text(const RelocRequest& message, const Vocabulary& vocabulary, DirectText* direct) {
  return with_body(request_header(message), encode_text(message.frame, vocabulary, direct));
}

RelocRequest decode_reloc_request_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                                       DirectText* direct) {
  return get_request(bytes, [&](auto body) { return decode_frame_text(body, sensor, direct); });
}

std::uint64_t number_of_request(std::span<const std::uint8_t> bytes) {
  return ByteReader(bytes).varint();
}

Bytes encode(const RelocFail& message) {
  ByteWriter out;
  out.varint(message.number);
  put_times(out, message.times);
  out.u8(static_cast<std::uint8_t>(message.reason));
  out.varint(message.padding);
  Bytes bytes = out.take();
  bytes.resize(bytes.size() + message.padding);
  return bytes;
}

RelocFail decode_reloc_fail(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  RelocFail message;
  message.number = in.varint();
  message.times = get_times(in);
  const std::uint8_t reason = in.u8();
  if (reason > static_cast<std::uint8_t>(RelocFailure::kUnreadable))
    throw DecodeError("RELOC_FAIL has no such reason");
  message.reason = static_cast<RelocFailure>(reason);
  message.padding = in.varint();
  if (message.padding != in.remaining()) throw DecodeError("RELOC_FAIL is cut off");
  return message;
}

Bytes encode(const RelocOk& message) {
  ByteWriter out = ok_header(message);
  put_delta(out, message.keyframe);
  return out.take();
}

RelocOk decode_reloc_ok(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  ByteReader in(bytes);
  RelocOk message = get_ok_header(in);
  message.keyframe = get_delta(in, sensor);
  in.expect_end();
  check(message);
  return message;
}

Bytes encode_text(const RelocOk& message, const FrameMessage& found, const Vocabulary& vocabulary,
                  DirectText* direct) {
  const MapUpdate carrier{.update = message.update,
                          .newest = message.keyframe.keyframes.at(0).id,
                          .times = {},
                          .map = message.keyframe,
                          .poses = {}};
  const Bytes keyframe = encode_text(carrier, vocabulary, direct);
  ByteWriter out = ok_header(message);
  out.varint(keyframe.size());
  Bytes bytes = with_body(std::move(out), keyframe);
  const Bytes frame = encode_text(found, vocabulary, direct);
  bytes.insert(bytes.end(), frame.begin(), frame.end());
  return bytes;
}

RelocOk decode_reloc_ok_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                             DirectText* direct) {
  ByteReader in(bytes);
  RelocOk message = get_ok_header(in);
  const auto keyframe = in.take(in.count(1));
  decode_frame_text(in.take(in.remaining()), sensor, direct);  // dropped: the mobile has the frame
  message.keyframe = decode_update_text(keyframe, sensor, direct).map;
  check(message);
  return message;
}

Bytes encode(const SuspendMessage& message) {
  ByteWriter out;
  out.varint(message.loss);
  return out.take();
}

SuspendMessage decode_suspend(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  const SuspendMessage message{in.varint()};
  in.expect_end();
  return message;
}

Bytes encode(const ResumeMessage& message) {
  ByteWriter out;
  out.varint(message.loss);
  IdStream().put(out, message.reference);
  return out.take();
}

ResumeMessage decode_resume(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  ResumeMessage message;
  message.loss = in.varint();
  message.reference = IdStream().get_or_none<KeyFrameId>(in);
  in.expect_end();
  return message;
}

}  // namespace slambed::wire
