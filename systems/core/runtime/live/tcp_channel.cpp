// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/tcp_channel.hpp"

#include "base/error.hpp"
#include "runtime/message_queue.hpp"
#include "runtime/message_record.hpp"

namespace slambed {
TcpChannel::TcpChannel(LiveRuntime& runtime, Observer& observer, ChannelOptions options,
                       std::function<void()> wake_io)
    : runtime_(runtime),
      observer_(observer),
      options_(std::move(options)),
      wake_io_(std::move(wake_io)),
      signal_(runtime.make_signal()) {}

std::uint64_t TcpChannel::send(std::uint8_t type, Bytes payload) {
  if (payload.size() > options_.max_payload) {
    throw Error(ExitCode::kInternal, "channel " + options_.name + ": message of " +
                                         std::to_string(payload.size()) +
                                         " bytes is over the limit; raise max_payload");
  }
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
  if (dropped) record(*dropped, false, true);
  wake_io_();
  return sequence;
}

void TcpChannel::hold(bool held) {
  {
    std::lock_guard lock(mutex_);
    held_ = held;
  }
  wake_io_();
}

std::optional<Message> TcpChannel::try_receive() {
  std::optional<Message> message;
  {
    std::lock_guard lock(mutex_);
    if (incoming_.empty()) return std::nullopt;
    message = std::move(incoming_.front());
    incoming_.pop_front();
  }
  record(*message, true, false);
  return message;
}

PathStats TcpChannel::path() const {
  std::lock_guard lock(mutex_);
  PathStats stats;
  stats.connections = connections_;
  for (const Message& message : outgoing_) {
    stats.unacknowledged_bytes += size_on_wire(message);
  }
  if (fd_ >= 0) {
    stats.connected = true;
    stats.smoothed_rtt = smoothed_rtt(fd_);
    stats.unacknowledged_bytes += unacknowledged_bytes(fd_);
  }
  return stats;
}

std::optional<Message> TcpChannel::next_to_send() {
  std::lock_guard lock(mutex_);
  if (held_ || outgoing_.empty()) return std::nullopt;
  std::optional<Message> message(std::move(outgoing_.front()));
  outgoing_.pop_front();
  return message;
}

void TcpChannel::put_back(Message message) {
  std::optional<Message> dropped;
  {
    std::lock_guard lock(mutex_);
    if (options_.send_queue > 0 &&
        outgoing_.size() >= static_cast<std::size_t>(options_.send_queue)) {
      dropped = std::move(message);  // it is the oldest
    } else {
      outgoing_.push_front(std::move(message));
    }
  }
  if (dropped) record(*dropped, false, true);
}

bool TcpChannel::deliver(Message message) {
  std::optional<Message> dropped;
  {
    std::lock_guard lock(mutex_);
    if (message.sequence <= last_received_) return false;
    last_received_ = message.sequence;
    dropped = push_drop_oldest(incoming_, std::move(message), options_.receive_queue);
  }
  if (dropped) record(*dropped, true, true);
  signal_->notify();
  return true;
}

void TcpChannel::set_connection(int fd) {
  {
    std::lock_guard lock(mutex_);
    fd_ = fd;
    if (fd >= 0) ++connections_;
  }
  signal_->notify();
}

void TcpChannel::forget_peer_sequence() {
  std::lock_guard lock(mutex_);
  last_received_ = 0;
}

bool TcpChannel::idle() const {
  std::lock_guard lock(mutex_);
  return held_ || outgoing_.empty();
}

void TcpChannel::record_link(std::string_view event, std::string_view detail) const {
  observer_.link({.channel = options_.name, .event = event, .detail = detail});
}

void TcpChannel::record(const Message& message, bool incoming, bool dropped) const {
  observer_.message(record_of(message, options_.name, incoming, dropped));
}

}  // namespace slambed
