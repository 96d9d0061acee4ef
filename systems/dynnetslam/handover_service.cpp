// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/handover_service.hpp"

#include "wire/message_type.hpp"

namespace slambed::dynnetslam {
namespace {

constexpr auto type_of(wire::MessageType type) { return static_cast<std::uint8_t>(type); }

}  // namespace

void HandoverService::start() {
  node_.runtime().spawn("handover", [this](Worker& worker) { serve(worker); });
}

void HandoverService::serve(Worker& worker) {
  while (const auto message = channel_.receive(worker, kNever)) {
    try {
      take(worker, *message);
    } catch (const wire::DecodeError& error) {
      node_.log().warning(std::string(wire::message_name(message->type)) +
                          " refused: " + error.what());
    }
  }
}

void HandoverService::take(Worker& worker, const Message& message) {
  if (message.type == type_of(wire::MessageType::kState)) {
    const wire::StateMessage state = wire::decode_state(message.payload);
    channel_.send(type_of(wire::MessageType::kAck),
                  encode(wire::AckMessage{.sequence = message.sequence}));
    // Number 0 answers no hand-over: it says that one is needed.
    if (count(*mapping_.map()).keyframes == 0) answer(state.epoch, 0, false);
  } else if (message.type == type_of(wire::MessageType::kStop)) {
    stop(wire::decode_stop(message.payload));
  } else if (message.type == type_of(wire::MessageType::kStart)) {
    begin(worker, wire::decode_start(message.payload));
  } else if (message.type == type_of(wire::MessageType::kMapHandover)) {
    take_over(worker, message);
  }
}

void HandoverService::stop(const wire::StopMessage& stop) {
  if (stop.epoch <= epoch_) return;
  epoch_ = stop.epoch;
  mapping_.stop();
}

void HandoverService::begin(Worker&, const wire::StartMessage& start) {
  if (is_stale(start.epoch, start.number)) return;
  const bool possible = count(*mapping_.map()).keyframes > 0;
  if (possible) {
    epoch_ = start.epoch;
    mapping_.resume(epoch_);
  }
  answer(start.epoch, start.number, possible);
}

void HandoverService::take_over(Worker& worker, const Message& raw) {
  wire::MapHandover handover;
  std::optional<std::string> damage;
  worker.stage("parse", [&](StageUnits& units) {
    units.n1 = static_cast<double>(raw.payload.size()) / 1000;
    try {
      handover = wire::decode_handover(raw.payload, node_.peer().sensor());
    } catch (const wire::DecodeError& error) {
      damage = error.what();
    }
    return 0;
  });
  if (damage) throw wire::DecodeError(*damage);
  if (is_stale(handover.epoch, handover.number)) return;
  if (!handover.whole && count(*mapping_.map()).keyframes == 0) {
    return answer(handover.epoch, handover.number, false);
  }
  epoch_ = handover.epoch;
  mapping_.stop();
  const std::size_t keyframes = handover.changes.keyframes.size();
  const std::size_t points = handover.changes.points.size();
  const CommitReport report = mapping_.merge(worker, std::move(handover.changes));
  node_.log().write(JsonLine("handover_applied")
                        .add("epoch", handover.epoch)
                        .add("number", handover.number)
                        .add("keyframes", keyframes)
                        .add("points", points)
                        .add("applied", report.applied)
                        .add("stale", report.stale)
                        .add("unknown", report.unknown));
  mapping_.resume(epoch_);
  answer(handover.epoch, handover.number, true);
}

bool HandoverService::is_stale(std::uint64_t epoch, std::uint64_t number) {
  if (epoch >= epoch_) return false;
  node_.log().write(JsonLine("handover_declined")
                        .add("epoch", epoch)
                        .add("number", number)
                        .add("reason", "older epoch"));
  return true;
}

void HandoverService::answer(std::uint64_t epoch, std::uint64_t number, bool accepted) {
  channel_.send(type_of(wire::MessageType::kHandoverAck),
                encode(wire::HandoverAck{epoch, number, accepted}));
}

}  // namespace slambed::dynnetslam
