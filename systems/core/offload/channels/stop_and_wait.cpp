// SPDX-License-Identifier: Apache-2.0
#include "offload/channels/stop_and_wait.hpp"

#include "node/messaging.hpp"
#include "runtime/message_queue.hpp"
#include "runtime/message_record.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

/// Encodes in one number which message is acknowledged, and whether its length or the whole of it.
constexpr std::uint64_t ack_code(std::uint64_t sequence, bool whole) {
  return 2 * sequence + (whole ? 1 : 0);
}

}  // namespace

StopAndWaitChannel::StopAndWaitChannel(Runtime& runtime, Observer& observer, Channel& below,
                                       ChannelOptions options)
    : runtime_(runtime),
      observer_(observer),
      below_(below),
      options_(std::move(options)),
      signal_(runtime.make_signal()) {}

void StopAndWaitChannel::start() {
  runtime_.spawn("ack-" + options_.name, [this](Worker& worker) { run(worker); });
}

std::uint64_t StopAndWaitChannel::send(std::uint8_t type, Bytes payload) {
  Message message;
  message.type = type;
  message.queued = runtime_.now();
  message.payload = std::move(payload);
  std::optional<Message> dropped;
  std::uint64_t sequence = 0;
  {
    std::lock_guard lock(mutex_);
    message.sequence = sequence = next_sequence_++;
    dropped = push_drop_oldest(outgoing_, std::move(message), options_.send_queue);
  }
  if (dropped) record_drop(*dropped, false);
  below_.signal().notify();  // wakes the worker
  return sequence;
}

void StopAndWaitChannel::hold(bool held) {
  {
    std::lock_guard lock(mutex_);
    held_ = held;
  }
  below_.signal().notify();  // wakes the worker
}

std::optional<Message> StopAndWaitChannel::try_receive() {
  std::lock_guard lock(mutex_);
  if (incoming_.empty()) return std::nullopt;
  std::optional<Message> message(std::move(incoming_.front()));
  incoming_.pop_front();
  return message;
}

PathStats StopAndWaitChannel::path() const {
  PathStats stats = below_.path();
  std::lock_guard lock(mutex_);
  for (const Message& message : outgoing_) {
    stats.unacknowledged_bytes += size_on_wire(message);
  }
  stats.unacknowledged_bytes += announced_bytes_;
  return stats;
}

void StopAndWaitChannel::run(Worker& worker) {
  std::uint64_t connections = 0;
  while (!worker.stopping()) {
    const auto ticket = below_.signal().ticket();
    while (auto message = below_.try_receive()) on_message(std::move(*message));
    if (phase_ == Phase::kIdle) {
      begin_next();
    } else if (below_.path().connections != connection_) {
      announce();  // the transfer was lost with the old connection
    }
    if (const auto now = below_.path().connections; now != connections) {
      connections = now;
      signal_->notify();
    }
    worker.wait(below_.signal(), ticket, kNever);
  }
  signal_->notify();
}

void StopAndWaitChannel::on_message(Message message) {
  if (message.session != session_) {  // a restarted peer counts from 1 again
    session_ = message.session;
    last_delivered_ = 0;
    announced_.reset();
  }
  if (is(message, wire::AckMessage::kType)) {
    if (const auto ack = read(observer_, message, wire::decode_ack)) on_ack(ack->sequence);
  } else if (is(message, wire::AnnounceMessage::kType)) {
    const auto announced = read(observer_, message, wire::decode_announce);
    if (!announced) return;
    announced_ = announced;
    acknowledge(announced->sequence, false);
  } else {
    deliver(std::move(message));
  }
}

void StopAndWaitChannel::on_ack(std::uint64_t code) {
  if (phase_ == Phase::kAnnounced && code == ack_code(current_.sequence, false)) {
    phase_ = Phase::kSent;
    below_.send(current_.type, current_.payload);
    set_announced_bytes(0);
  } else if (phase_ == Phase::kSent && code == ack_code(current_.sequence, true)) {
    phase_ = Phase::kIdle;
  }
}

void StopAndWaitChannel::deliver(Message message) {
  if (!announced_) return;  // the rest of a transfer that began on another connection
  const wire::AnnounceMessage announced = *announced_;
  announced_.reset();
  acknowledge(announced.sequence, true);
  if (announced.sequence <= last_delivered_) return;
  last_delivered_ = announced.sequence;
  message.sequence = announced.sequence;
  message.queued = announced.queued;
  std::optional<Message> dropped;
  {
    std::lock_guard lock(mutex_);
    dropped = push_drop_oldest(incoming_, std::move(message), options_.receive_queue);
  }
  if (dropped) record_drop(*dropped, true);
  signal_->notify();
}

void StopAndWaitChannel::begin_next() {
  {
    std::lock_guard lock(mutex_);
    if (held_ || outgoing_.empty()) return;
    current_ = std::move(outgoing_.front());
    outgoing_.pop_front();
    announced_bytes_ = size_on_wire(current_);
  }
  announce();
}

void StopAndWaitChannel::announce() {
  phase_ = Phase::kAnnounced;
  set_announced_bytes(size_on_wire(current_));
  connection_ = below_.path().connections;
  slambed::send(below_, wire::AnnounceMessage{.sequence = current_.sequence,
                                              .queued = current_.queued,
                                              .bytes = current_.payload.size()});
}

void StopAndWaitChannel::set_announced_bytes(std::uint64_t bytes) {
  std::lock_guard lock(mutex_);
  announced_bytes_ = bytes;
}

void StopAndWaitChannel::acknowledge(std::uint64_t sequence, bool whole) {
  slambed::send(below_, wire::AckMessage{.sequence = ack_code(sequence, whole)});
}

void StopAndWaitChannel::record_drop(const Message& message, bool incoming) const {
  observer_.message(record_of(message, options_.name, incoming, true));
}

}  // namespace slambed
