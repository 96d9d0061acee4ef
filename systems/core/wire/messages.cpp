// SPDX-License-Identifier: Apache-2.0
#include "wire/messages.hpp"

#include <string>

#include "base/error.hpp"
#include "wire/delta_codec.hpp"
#include "wire/feature_codec.hpp"
#include "wire/id_codec.hpp"

namespace slambed::wire {
namespace {

/// Decodes a whole payload. Throws DecodeError if bytes are left over.
template <typename Get>
auto whole(std::span<const std::uint8_t> bytes, Get get) {
  ByteReader in(bytes);
  auto message = get(in);
  in.expect_end();
  return message;
}

bool number_fits(const KeyFrameMessage& message) {
  const std::size_t keyframes = message.delta.keyframes.size();
  return keyframes == 1 || (keyframes == 2 && message.first);
}

}  // namespace

void require_keyframes(const KeyFrameMessage& message) {
  if (number_fits(message)) return;
  throw Error(ExitCode::kInternal, "wire: a KEYFRAME cannot hold " +
                                       std::to_string(message.delta.keyframes.size()) +
                                       " keyframes");
}

void expect_keyframes(const KeyFrameMessage& message) {
  if (!number_fits(message) || message.delta.keyframes.back().id != message.keyframe)
    throw DecodeError("KEYFRAME does not hold its keyframe");
}

Bytes encode(const KeyFrameMessage& message) {
  require_keyframes(message);
  ByteWriter out;
  IdStream().put(out, message.keyframe);
  out.time(message.captured);
  out.u8(message.urgent);
  out.u8(message.first);
  out.u8(message.whole);
  out.u8(message.after_relocalization);
  out.varint(message.applied_update);
  IdStream().put(out, message.newest_edge_point);
  put_delta(out, message.delta, FreshPoints::kDerived);
  return out.take();
}

KeyFrameMessage decode_keyframe(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  return whole(bytes, [&](ByteReader& in) {
    KeyFrameMessage message;
    message.keyframe = IdStream().get<KeyFrameId>(in);
    message.captured = in.time();
    message.urgent = in.flag();
    message.first = in.flag();
    message.whole = in.flag();
    message.after_relocalization = in.flag();
    message.applied_update = in.varint();
    message.newest_edge_point = IdStream().get_or_none<MapPointId>(in);
    message.delta = get_delta(in, sensor);
    expect_keyframes(message);
    return message;
  });
}

Bytes encode(const MapUpdate& message) {
  ByteWriter out;
  out.varint(message.update);
  IdStream().put(out, message.newest);
  IdStream().put(out, message.newest_past_probation);
  for (const auto time : kUpdateTimes) out.time(message.times.*time);
  put_delta(out, message.map);
  put_poses(out, message.poses);
  return out.take();
}

MapUpdate decode_update(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  return whole(bytes, [&](ByteReader& in) {
    MapUpdate message;
    message.update = in.varint();
    message.newest = IdStream().get<KeyFrameId>(in);
    message.newest_past_probation = IdStream().get_or_none<KeyFrameId>(in);
    for (const auto time : kUpdateTimes) message.times.*time = in.time();
    message.map = get_delta(in, sensor);
    message.poses = get_poses(in);
    if (message.map.keyframes.empty()) throw DecodeError("update holds no keyframe");
    return message;
  });
}

Bytes encode(const FrameMessage& message) {
  ByteWriter out;
  out.varint(message.frame_index);
  out.f64(message.timestamp_s);
  put_features(out, *message.features);
  return out.take();
}

FrameMessage decode_frame(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  return whole(bytes, [&](ByteReader& in) {
    if (!sensor) throw DecodeError("frame from an unknown camera");
    FrameMessage message;
    message.frame_index = in.varint();
    message.timestamp_s = in.f64();
    message.features = get_features(in, sensor);
    return message;
  });
}

Bytes encode(const AckMessage& message) {
  ByteWriter out;
  out.varint(message.sequence);
  return out.take();
}

AckMessage decode_ack(std::span<const std::uint8_t> bytes) {
  return whole(bytes, [](ByteReader& in) { return AckMessage{in.varint()}; });
}

Bytes encode(const AnnounceMessage& message) {
  ByteWriter out;
  out.varint(message.sequence);
  out.time(message.queued);
  out.varint(message.bytes);
  return out.take();
}

AnnounceMessage decode_announce(std::span<const std::uint8_t> bytes) {
  return whole(bytes, [](ByteReader& in) {
    AnnounceMessage message;
    message.sequence = in.varint();
    message.queued = in.time();
    message.bytes = in.varint();
    return message;
  });
}

Bytes encode(const ByeMessage& message) {
  ByteWriter out;
  out.varint(message.last_keyframe_sequence);
  out.varint(message.keyframes);
  out.varint(message.points);
  return out.take();
}

ByeMessage decode_bye(std::span<const std::uint8_t> bytes) {
  return whole(bytes, [](ByteReader& in) {
    ByeMessage message;
    message.last_keyframe_sequence = in.varint();
    message.keyframes = in.varint();
    message.points = in.varint();
    return message;
  });
}

Bytes encode_poses(const std::vector<KeyFramePose>& poses) {
  ByteWriter out;
  put_poses(out, poses);
  return out.take();
}

std::vector<KeyFramePose> decode_poses(std::span<const std::uint8_t> bytes) {
  return whole(bytes, [](ByteReader& in) { return get_poses(in); });
}

}  // namespace slambed::wire
