// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/update_receiver.hpp"

#include "node/messaging.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

bool is_relocalization(const Message& message) { return is(message, wire::kRelocMap); }

bool is_update(const Message& message) {
  return is_relocalization(message) || is(message, wire::kMapUpdate);
}

}  // namespace

bool UpdateArrival::relocalization() const { return is_relocalization(raw); }

std::optional<Message> UpdateReceiver::take() {
  while (auto message = channel_.try_receive()) {
    if (is_update(*message)) return message;
  }
  return std::nullopt;
}

std::optional<UpdateArrival> UpdateReceiver::read(Worker& worker, Message message) {
  auto update = slambed::read(
      worker, codec_.parse_stage(), node_.log(), message,
      [&](const Bytes& bytes) { return codec_.update(worker, bytes, node_.sensor()); });
  if (!update) return std::nullopt;
  message.payload = {};
  UpdateArrival arrival{.raw = std::move(message), .update = std::move(*update), .map = nullptr};
  node_.log().write(JsonLine("update_received")
                        .add("update", arrival.update.update)
                        .add("newest_keyframe", arrival.update.newest.value)
                        .add("keyframes", arrival.update.map.keyframes.size())
                        .add("points", arrival.update.map.points.size()));
  return arrival;
}

}  // namespace slambed
