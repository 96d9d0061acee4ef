// SPDX-License-Identifier: Apache-2.0
#include "wire/frame_messages.hpp"

#include <array>

#include "wire/delta_codec.hpp"
#include "wire/id_codec.hpp"
#include "wire/mask_codec.hpp"

namespace slambed::wire {
namespace {

constexpr std::array kMoments = {&FrameTimes::captured, &FrameTimes::dequeued, &FrameTimes::queued,
                                 &FrameTimes::received, &FrameTimes::begun,    &FrameTimes::done};
constexpr std::array kParts = {&FrameTimes::nrcc, &FrameTimes::extract, &FrameTimes::track,
                               &FrameTimes::local_mapping, &FrameTimes::loop_closing};

}  // namespace

Bytes encode(const FrameImage& message) {
  ByteWriter out;
  out.reserve(message.jpeg.size() + 64);
  out.varint(message.frame_index);
  out.f64(message.timestamp_s);
  out.time(message.captured);
  out.time(message.dequeued);
  out.varint(message.jpeg.size());
  Bytes bytes = out.take();
  bytes.insert(bytes.end(), message.jpeg.begin(), message.jpeg.end());
  return bytes;
}

FrameImage decode_frame_image(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  FrameImage message;
  message.frame_index = in.varint();
  message.timestamp_s = in.f64();
  message.captured = in.time();
  message.dequeued = in.time();
  const auto jpeg = in.take(in.count(1));
  message.jpeg.assign(jpeg.begin(), jpeg.end());
  in.expect_end();
  return message;
}

Bytes encode(const FrameResult& message) {
  ByteWriter out;
  out.varint(message.sequence);
  out.varint(message.frame_index);
  out.u8(static_cast<std::uint8_t>(message.state));
  out.u8(message.reset);
  if (message.state == FrameState::kOk) {
    put_pose(out, message.T_cw);
    IdStream().put(out, message.reference);
    put_pose(out, message.T_cr);
  }
  out.varint(message.features);
  out.varint(message.inliers);
  for (const auto moment : kMoments) out.time(message.times.*moment);
  for (const auto part : kParts) out.time(message.times.*part);
  put_masks(out, message.masks);
  return out.take();
}

FrameResult decode_frame_result(std::span<const std::uint8_t> bytes,
                                const std::shared_ptr<const Sensor>& sensor) {
  if (!sensor) throw DecodeError("FRAME_RESULT of an unknown camera");
  ByteReader in(bytes);
  FrameResult message;
  message.sequence = in.varint();
  message.frame_index = in.varint();
  const std::uint8_t state = in.u8();
  if (state > static_cast<std::uint8_t>(FrameState::kLost))
    throw DecodeError("FRAME_RESULT has an unknown state");
  message.state = static_cast<FrameState>(state);
  message.reset = in.flag();
  if (message.state == FrameState::kOk) {
    message.T_cw = get_pose(in);
    message.reference = IdStream().get<KeyFrameId>(in);
    message.T_cr = get_pose(in);
  }
  message.features = in.varint32();
  message.inliers = in.varint32();
  for (const auto moment : kMoments) message.times.*moment = in.time();
  for (const auto part : kParts) {
    message.times.*part = in.time();
    if (message.times.*part < Duration::zero())
      throw DecodeError("FRAME_RESULT has a part of negative length");
  }
  message.masks = get_masks(in, sensor->camera.width, sensor->camera.height);
  in.expect_end();
  return message;
}

}  // namespace slambed::wire
