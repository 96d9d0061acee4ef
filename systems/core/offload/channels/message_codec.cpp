// SPDX-License-Identifier: Apache-2.0
#include "offload/channels/message_codec.hpp"

#include "features/default_vocabulary.hpp"
#include "offload/maps/update_content.hpp"
#include "wire/compatibility_codec.hpp"

namespace slambed {

MessageCodec::MessageCodec(Form form) : form_(form) {
  if (!text()) return;
  vocabulary_ = default_vocabulary();
  direct_ = std::make_shared<wire::DirectText>();
}

wire::DirectText* MessageCodec::direct(const Worker& worker) const {
  return worker.charged() ? direct_.get() : nullptr;
}

template <typename Write>
Bytes MessageCodec::staged(Worker& worker, Write write) const {
  return worker.stage(text() ? "serialize_text" : "serialize", [&](StageUnits& units) {
    Bytes bytes = write();
    units.n1 = kilobytes(bytes);
    return bytes;
  });
}

template <typename Message, typename... Others>
Bytes MessageCodec::written(Worker& worker, const Message& message, const Others&... others) const {
  return staged(worker, [&] {
    return text() ? encode_text(message, others..., *vocabulary_, direct(worker)) : encode(message);
  });
}

template <typename Text, typename Binary>
auto MessageCodec::read(const Worker& worker, const Bytes& bytes, const wire::SensorPtr& sensor,
                        Text from_text, Binary from_binary) const {
  return text() ? from_text(bytes, sensor, direct(worker)) : from_binary(bytes, sensor);
}

Bytes MessageCodec::serialize(Worker& worker, const wire::KeyFrameMessage& message,
                              const Map& local) const {
  return staged(worker, [&] {
    if (!text()) return encode(message);
    const auto ids = keyframes_of(message.delta);
    const MapDelta whole =
        local.read([&](const MapView& view) { return extract_keyframes(view, ids); });
    return encode_text(message, whole.points, *vocabulary_, direct(worker));
  });
}

Bytes MessageCodec::serialize(Worker& worker, const wire::MapUpdate& message) const {
  return written(worker, message);
}

Bytes MessageCodec::serialize(Worker& worker, const wire::FrameMessage& message) const {
  return written(worker, message);
}

Bytes MessageCodec::serialize(Worker& worker, const wire::RelocRequest& message) const {
  return written(worker, message);
}

Bytes MessageCodec::serialize(Worker& worker, const wire::RelocOk& message,
                              const wire::FrameMessage& asked) const {
  return written(worker, message, asked);
}

wire::KeyFrameMessage MessageCodec::keyframe(const Worker& worker, const Bytes& bytes,
                                             const wire::SensorPtr& sensor) const {
  return read(worker, bytes, sensor, wire::decode_keyframe_text, wire::decode_keyframe);
}

wire::MapUpdate MessageCodec::update(const Worker& worker, const Bytes& bytes,
                                     const wire::SensorPtr& sensor) const {
  return read(worker, bytes, sensor, wire::decode_update_text, wire::decode_update);
}

wire::FrameMessage MessageCodec::frame(const Worker& worker, const Bytes& bytes,
                                       const wire::SensorPtr& sensor) const {
  return read(worker, bytes, sensor, wire::decode_frame_text, wire::decode_frame);
}

wire::RelocRequest MessageCodec::request(const Worker& worker, const Bytes& bytes,
                                         const wire::SensorPtr& sensor) const {
  return read(worker, bytes, sensor, wire::decode_reloc_request_text, wire::decode_reloc_request);
}

wire::RelocOk MessageCodec::found(const Worker& worker, const Bytes& bytes,
                                  const wire::SensorPtr& sensor) const {
  return read(worker, bytes, sensor, wire::decode_reloc_ok_text, wire::decode_reloc_ok);
}

bool writes_text(const Parameters& parameters) {
  return parameters.text("codec") == "compatibility";
}

MessageCodec message_codec(const Parameters& parameters) {
  return MessageCodec(writes_text(parameters) ? MessageCodec::Form::kCompatibility
                                              : MessageCodec::Form::kBinary);
}

}  // namespace slambed
