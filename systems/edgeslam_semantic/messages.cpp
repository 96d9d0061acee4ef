// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/messages.hpp"

#include "wire/delta_codec.hpp"
#include "wire/id_codec.hpp"
#include "wire/mask_codec.hpp"

namespace slambed::edgeslam_semantic {
namespace {

using wire::ByteReader, wire::ByteWriter, wire::DecodeError, wire::IdStream, wire::kUpdateTimes;
using wire::get_delta, wire::get_masks, wire::get_pose;
using wire::put_delta, wire::put_masks, wire::put_pose;

template <typename IdType>
void put_ids(ByteWriter& out, const std::vector<IdType>& ids) {
  IdStream stream;
  out.varint(ids.size());
  for (const IdType id : ids) stream.put(out, id);
}

template <typename IdType>
std::vector<IdType> get_ids(ByteReader& in) {
  IdStream stream;
  std::vector<IdType> ids(in.count(1));
  for (IdType& id : ids) id = stream.get<IdType>(in);
  return ids;
}

}  // namespace

Bytes encode(const SemanticKeyFrame& message) {
  ByteWriter out;
  out.reserve(message.jpeg.size() + 64);
  IdStream().put(out, message.map_id);
  out.time(message.captured);
  out.varint(message.applied_slice);
  IdStream().put(out, message.newest_edge_point);
  out.f64(message.n_m);
  put_delta(out, message.delta);
  out.varint(message.jpeg.size());
  Bytes bytes = out.take();
  bytes.insert(bytes.end(), message.jpeg.begin(), message.jpeg.end());
  return bytes;
}

SemanticKeyFrame decode_semantic_keyframe(std::span<const std::uint8_t> bytes,
                                          const SensorPtr& sensor) {
  ByteReader in(bytes);
  SemanticKeyFrame message;
  message.map_id = IdStream().get<KeyFrameId>(in);
  message.captured = in.time();
  message.applied_slice = in.varint();
  message.newest_edge_point = IdStream().get_or_none<MapPointId>(in);
  message.n_m = in.f64();
  if (!(message.n_m >= 0 && message.n_m <= 1))
    throw DecodeError("SEMANTIC_KEYFRAME has a threshold outside of 0 to 1");
  message.delta = get_delta(in, sensor);
  const std::size_t keyframes = message.delta.keyframes.size();
  if (keyframes == 0 || keyframes > kMostSemanticKeyFrames)
    throw DecodeError("SEMANTIC_KEYFRAME has none or too many keyframes");
  const auto jpeg = in.take(in.count(1));
  message.jpeg.assign(jpeg.begin(), jpeg.end());
  in.expect_end();
  return message;
}

Bytes encode(const OptResult& message) {
  ByteWriter out;
  IdStream ids;
  ids.put(out, message.map_id);
  out.varint(message.number);
  ids.put(out, message.keyframe);
  put_pose(out, message.T_cw);
  for (const auto moment : kUpdateTimes) out.time(message.times.*moment);
  put_delta(out, message.changes);
  put_ids(out, message.left_keyframes);
  put_ids(out, message.left_points);
  return out.take();
}

OptResult decode_opt_result(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  IdStream ids;
  OptResult message;
  message.map_id = ids.get<KeyFrameId>(in);
  message.number = in.varint();
  message.keyframe = ids.get<KeyFrameId>(in);
  message.T_cw = get_pose(in);
  for (const auto moment : kUpdateTimes) message.times.*moment = in.time();
  message.changes = get_delta(in, nullptr);
  message.left_keyframes = get_ids<KeyFrameId>(in);
  message.left_points = get_ids<MapPointId>(in);
  in.expect_end();
  return message;
}

Bytes encode(const MaskMessage& message) {
  ByteWriter out;
  IdStream ids;
  ids.put(out, message.map_id);
  ids.put(out, message.keyframe);
  out.time(message.took);
  put_masks(out, message.masks);
  return out.take();
}

MaskMessage decode_mask(std::span<const std::uint8_t> bytes, const SensorPtr& sensor) {
  if (!sensor) throw DecodeError("MASK of an unknown camera");
  ByteReader in(bytes);
  IdStream ids;
  MaskMessage message;
  message.map_id = ids.get<KeyFrameId>(in);
  message.keyframe = ids.get<KeyFrameId>(in);
  message.took = in.time();
  if (message.took < Duration::zero()) throw DecodeError("MASK took a negative time");
  message.masks = get_masks(in, sensor->camera.width, sensor->camera.height);
  in.expect_end();
  return message;
}

Bytes encode(const NoMaskMessage& message) {
  ByteWriter out;
  IdStream ids;
  ids.put(out, message.map_id);
  ids.put(out, message.keyframe);
  out.time(message.took);
  out.u8(static_cast<std::uint8_t>(message.reason));
  return out.take();
}

NoMaskMessage decode_no_mask(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  IdStream ids;
  NoMaskMessage message;
  message.map_id = ids.get<KeyFrameId>(in);
  message.keyframe = ids.get<KeyFrameId>(in);
  message.took = in.time();
  if (message.took < Duration::zero()) throw DecodeError("NO_MASK took a negative time");
  const std::uint8_t reason = in.u8();
  if (reason > static_cast<std::uint8_t>(NoMaskReason::kNotMapped))
    throw DecodeError("NO_MASK has an unknown reason");
  message.reason = static_cast<NoMaskReason>(reason);
  in.expect_end();
  return message;
}

Bytes encode(const KeyFrameRefused& message) {
  ByteWriter out;
  out.varint(message.sequence);
  return out.take();
}

KeyFrameRefused decode_keyframe_refused(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  const KeyFrameRefused message{.sequence = in.varint()};
  in.expect_end();
  return message;
}

}  // namespace slambed::edgeslam_semantic
