// SPDX-License-Identifier: Apache-2.0
#include "offload/message_codec.hpp"

#include "features/default_vocabulary.hpp"
#include "offload/update_content.hpp"
#include "wire/compatibility_codec.hpp"

namespace slambed {
namespace {

wire::TextMeans means_of(const Worker& worker) {
  return worker.charged() ? wire::TextMeans::kDirect : wire::TextMeans::kStreams;
}

}  // namespace

MessageCodec::MessageCodec(Form form) : form_(form) {
  if (text()) vocabulary_ = default_vocabulary();
}

template <typename Write>
Bytes MessageCodec::staged(Worker& worker, Write write) const {
  return worker.stage(text() ? "serialise_text" : "serialise", [&](StageUnits& units) {
    Bytes bytes = write();
    units.n1 = kilobytes(bytes);
    return bytes;
  });
}

Bytes MessageCodec::serialise(Worker& worker, const wire::KeyFrameMessage& message,
                              const Map& local) const {
  return staged(worker, [&] {
    if (!text()) return encode(message);
    const auto ids = keyframes_of(message.delta);
    const MapDelta whole =
        local.read([&](const MapView& view) { return extract_keyframes(view, ids); });
    return encode_text(message, whole.points, *vocabulary_, means_of(worker));
  });
}

Bytes MessageCodec::serialise(Worker& worker, const wire::MapUpdate& message) const {
  return staged(worker, [&] {
    return text() ? encode_text(message, *vocabulary_, means_of(worker)) : encode(message);
  });
}

Bytes MessageCodec::serialise(Worker& worker, const wire::FrameMessage& message) const {
  return staged(worker, [&] {
    return text() ? encode_text(message, *vocabulary_, means_of(worker)) : encode(message);
  });
}

Bytes MessageCodec::serialise(Worker& worker, const wire::RelocRequest& message) const {
  return staged(worker, [&] {
    return text() ? encode_text(message, *vocabulary_, means_of(worker)) : encode(message);
  });
}

Bytes MessageCodec::serialise(Worker& worker, const wire::RelocOk& message,
                              const wire::FrameMessage& asked) const {
  return staged(worker, [&] {
    return text() ? encode_text(message, asked, *vocabulary_, means_of(worker)) : encode(message);
  });
}

wire::KeyFrameMessage MessageCodec::keyframe(const Worker& worker, const Bytes& bytes,
                                             const wire::SensorPtr& sensor) const {
  return text() ? wire::decode_keyframe_text(bytes, sensor, means_of(worker))
                : wire::decode_keyframe(bytes, sensor);
}

wire::MapUpdate MessageCodec::update(const Worker& worker, const Bytes& bytes,
                                     const wire::SensorPtr& sensor) const {
  return text() ? wire::decode_update_text(bytes, sensor, means_of(worker))
                : wire::decode_update(bytes, sensor);
}

wire::FrameMessage MessageCodec::frame(const Worker& worker, const Bytes& bytes,
                                       const wire::SensorPtr& sensor) const {
  return text() ? wire::decode_frame_text(bytes, sensor, means_of(worker))
                : wire::decode_frame(bytes, sensor);
}

wire::RelocRequest MessageCodec::request(const Worker& worker, const Bytes& bytes,
                                         const wire::SensorPtr& sensor) const {
  return text() ? wire::decode_reloc_request_text(bytes, sensor, means_of(worker))
                : wire::decode_reloc_request(bytes, sensor);
}

wire::RelocOk MessageCodec::found(const Worker& worker, const Bytes& bytes,
                                  const wire::SensorPtr& sensor) const {
  return text() ? wire::decode_reloc_ok_text(bytes, sensor, means_of(worker))
                : wire::decode_reloc_ok(bytes, sensor);
}

}  // namespace slambed
