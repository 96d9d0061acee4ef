// SPDX-License-Identifier: Apache-2.0
#include "offload/handover_server.hpp"

#include "wire/message_type.hpp"

namespace slambed {
namespace {}  // namespace

void HandoverServer::start() {
  node_.runtime().spawn("handover", [this](Worker& worker) { listen(worker); });
  node_.runtime().spawn("merge", [this](Worker& worker) { merge(worker); });
}

void HandoverServer::listen(Worker& worker) {
  while (auto message = channel_.receive(worker, kNever)) {
    const auto type = message->type;
    try {
      take(std::move(*message));
    } catch (const wire::DecodeError& error) {
      node_.log().warning(std::string(wire::message_name(type)) + " refused: " + error.what());
    }
  }
}

void HandoverServer::take(Message message) {
  if (message.type == wire::type_of(wire::MessageType::kState)) {
    const wire::StateMessage state = wire::decode_state(message.payload);
    channel_.send(wire::type_of(wire::MessageType::kAck),
                  encode(wire::AckMessage{.sequence = message.sequence}));
    // Number 0 answers no hand-over: it says that one is needed.
    if (count(*mapping_.mapper().map()).keyframes == 0) answer(state.epoch, 0, false);
  } else if (message.type == wire::type_of(wire::MessageType::kStop)) {
    stop(wire::decode_stop(message.payload));
  } else if (message.type == wire::type_of(wire::MessageType::kStart) ||
             message.type == wire::type_of(wire::MessageType::kMapHandover)) {
    arrived_.put(std::move(message));
  }
}

void HandoverServer::stop(const wire::StopMessage& stop) {
  std::lock_guard lock(mutex_);
  if (stop.epoch <= epoch_) return;
  epoch_ = stop.epoch;
  mapping_.stop();
}

void HandoverServer::merge(Worker& worker) {
  while (const auto message = arrived_.take(worker)) {
    try {
      if (message->type == wire::type_of(wire::MessageType::kStart)) {
        begin(wire::decode_start(message->payload));
      } else {
        take_over(worker, *message);
      }
    } catch (const wire::DecodeError& error) {
      node_.log().warning(std::string(wire::message_name(message->type)) +
                          " refused: " + error.what());
    }
  }
}

void HandoverServer::begin(const wire::StartMessage& start) {
  if (is_stale(start.epoch, start.number)) return;
  const bool possible = count(*mapping_.mapper().map()).keyframes > 0;
  if (possible) resume(start.epoch);
  answer(start.epoch, start.number, possible);
}

void HandoverServer::resume(std::uint64_t epoch) {
  std::lock_guard lock(mutex_);
  if (epoch < epoch_) return;  // stopped again meanwhile
  epoch_ = epoch;
  mapping_.resume(epoch);
}

void HandoverServer::take_over(Worker& worker, const Message& raw) {
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
  // Sent again because a connection broke, but the first one had come; the map has gone on since.
  if (handover.number == applied_) return answer(handover.epoch, handover.number, true);
  if (!handover.whole && count(*mapping_.mapper().map()).keyframes == 0) {
    return answer(handover.epoch, handover.number, false);
  }
  mapping_.stop();
  const std::size_t keyframes = handover.changes.keyframes.size();
  const std::size_t points = handover.changes.points.size();
  const CommitReport report = mapping_.mapper().merge(worker, std::move(handover.changes));
  node_.log().write(JsonLine("handover_applied")
                        .add("epoch", handover.epoch)
                        .add("number", handover.number)
                        .add("keyframes", keyframes)
                        .add("points", points)
                        .add("applied", report.applied)
                        .add("stale", report.stale)
                        .add("unknown", report.unknown));
  applied_ = handover.number;
  resume(handover.epoch);
  answer(handover.epoch, handover.number, true);
}

bool HandoverServer::is_stale(std::uint64_t epoch, std::uint64_t number) {
  {
    std::lock_guard lock(mutex_);
    if (epoch >= epoch_) return false;
  }
  node_.log().write(JsonLine("handover_declined")
                        .add("epoch", epoch)
                        .add("number", number)
                        .add("reason", "older epoch"));
  return true;
}

void HandoverServer::answer(std::uint64_t epoch, std::uint64_t number, bool accepted) {
  channel_.send(wire::type_of(wire::MessageType::kHandoverAck),
                encode(wire::HandoverAck{epoch, number, accepted}));
}

}  // namespace slambed
