// SPDX-License-Identifier: Apache-2.0
#include "offload/uplink/keyframe_intake.hpp"

#include "node/messaging.hpp"
#include "offload/uplink/admission.hpp"
#include "wire/message_type.hpp"

namespace slambed {

KeyFrameIntake::KeyFrameIntake(EdgeNode& node, Channel& channel, MessageCodec codec,
                               KeyFrameRecipient& recipient)
    : node_(node),
      channel_(channel),
      codec_(std::move(codec)),
      recipient_(recipient),
      received_(node.runtime().make_signal()) {}

void KeyFrameIntake::start() {
  node_.runtime().spawn("receiver", [this](Worker& worker) { receive(worker); });
}

void KeyFrameIntake::receive(Worker& worker) {
  while (const auto message = next(worker)) {
    if (is(*message, wire::kKeyFrame)) on_keyframe(worker, *message);
    received_sequence_ = message->sequence;
    received_->notify();
  }
}

std::optional<Message> KeyFrameIntake::next(Worker& worker) {
  if (!idle_) return channel_.receive(worker, kNever);
  while (!worker.stopping()) {
    const auto ticket = channel_.signal().ticket();
    const bool looked = looks_.exchange(false);
    if (looked || idle_())
      if (auto message = channel_.try_receive()) return message;
    worker.wait(channel_.signal(), ticket, kNever);
  }
  return std::nullopt;
}

void KeyFrameIntake::look() {
  if (!idle_) return;
  looks_ = true;
  channel_.signal().notify();
}

void KeyFrameIntake::on_keyframe(Worker& worker, const Message& raw) {
  AdmittedKeyFrame keyframe;
  std::optional<std::string_view> declined;
  const bool parsed = worker.stage(codec_.parse_stage(), [&](StageUnits& units) {
    units.n1 = kilobytes(raw.payload);
    auto read_well = read(node_.log(), raw, [&](const Bytes& bytes) {
      return codec_.keyframe(worker, bytes, node_.peer().sensor());
    });
    if (!read_well) return false;
    keyframe.message = std::move(*read_well);
    recipient_.received(keyframe.message);
    declined = recipient_.keyframe_decline_reason(keyframe.message);
    return true;
  });
  if (!parsed) return;
  if (declined) {
    node_.log().write(JsonLine("keyframe_declined")
                          .add("keyframe", keyframe.message.keyframe.value)
                          .add("reason", *declined));
    if (asks_ && *declined == kNoMap) {
      send(channel_, wire::kKeyFrameWanted);
    }
    return;
  }
  keyframe.times.captured = keyframe.message.captured;
  keyframe.times.queued = raw.queued;
  keyframe.times.received = raw.received;
  recipient_.admit(worker, std::move(keyframe));
}

void KeyFrameIntake::wait_for(Worker& worker, std::uint64_t sequence, RunTime deadline) {
  for (;;) {
    const auto ticket = received_->ticket();
    if (received_sequence_ >= sequence || worker.stopping() || worker.now() >= deadline) return;
    worker.wait(*received_, ticket, deadline);
  }
}

}  // namespace slambed
