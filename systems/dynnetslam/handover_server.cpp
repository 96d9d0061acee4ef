// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/handover_server.hpp"

namespace slambed {

HandoverServer::HandoverServer(EdgeNode& node, EdgeMapping& mapping, Channel& channel)
    : node_(node),
      mapping_(mapping),
      channel_(channel),
      inbox_(node.log()),
      arrived_(node.runtime()) {
  const auto later = [this](Message& message) { arrived_.put(std::move(message)); };
  inbox_.on<wire::StateMessage>(wire::decode_state,
                                [this](const wire::StateMessage& state, const Message& raw) {
                                  send(channel_, wire::AckMessage{.sequence = raw.sequence});
                                  if (count(*mapping_.mapper().map()).keyframes == 0)
                                    answer(state.epoch, 0, wire::HandoverAnswer::kNoMap);
                                });
  inbox_.on<wire::StopMessage>(wire::decode_stop, [this](const wire::StopMessage& message,
                                                         const Message&) { stop(message); });
  inbox_.on(wire::StartMessage::kType, later).on(wire::MapHandover::kType, later);
}

void HandoverServer::start() {
  node_.runtime().spawn("handover", [this](Worker& worker) { listen(worker); });
  node_.runtime().spawn("merge", [this](Worker& worker) { work(worker); });
}

void HandoverServer::listen(Worker& worker) {
  while (auto message = channel_.receive(worker, kNever)) inbox_.dispatch(std::move(*message));
}

void HandoverServer::stop(const wire::StopMessage& stop) {
  std::lock_guard lock(mutex_);
  if (stop.epoch <= epoch_) return;
  epoch_ = stop.epoch;
  mapping_.stop();
}

void HandoverServer::work(Worker& worker) {
  while (const auto message = arrived_.take(worker)) {
    if (is(*message, wire::MapHandover::kType)) {
      apply(worker, *message);
    } else if (const auto start = read(node_.log(), *message, wire::decode_start)) {
      begin(*start);
    }
  }
}

void HandoverServer::begin(const wire::StartMessage& start) {
  if (is_stale(start.epoch, start.number)) return;
  const bool possible = count(*mapping_.mapper().map()).keyframes > 0;
  if (possible) resume(start.epoch);
  answer(start.epoch, start.number,
         possible ? wire::HandoverAnswer::kAccepted : wire::HandoverAnswer::kDeclined);
}

void HandoverServer::resume(std::uint64_t epoch) {
  std::lock_guard lock(mutex_);
  if (epoch < epoch_) return;  // stopped again meanwhile
  epoch_ = epoch;
  mapping_.resume(epoch);
}

void HandoverServer::apply(Worker& worker, const Message& raw) {
  auto read_well = read(worker, "parse", node_.log(), raw, [this](const Bytes& bytes) {
    return wire::decode_handover(bytes, node_.peer().sensor());
  });
  if (!read_well) {
    // Without an answer the mobile would wait forever.
    if (const auto head = wire::handover_head(raw.payload))
      answer(head->epoch, head->number, wire::HandoverAnswer::kDeclined);
    return;
  }
  wire::MapHandover& handover = *read_well;
  if (is_stale(handover.epoch, handover.number)) return;
  // Sent again after a broken connection, but the first copy arrived and the map has changed since.
  if (handover.number == applied_)
    return answer(handover.epoch, handover.number, wire::HandoverAnswer::kAccepted);
  if (!handover.whole && count(*mapping_.mapper().map()).keyframes == 0) {
    return answer(handover.epoch, handover.number, wire::HandoverAnswer::kDeclined);
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
  answer(handover.epoch, handover.number, wire::HandoverAnswer::kAccepted);
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

void HandoverServer::answer(std::uint64_t epoch, std::uint64_t number,
                            wire::HandoverAnswer answer) {
  send(channel_, wire::HandoverAck{epoch, number, answer});
}

}  // namespace slambed
