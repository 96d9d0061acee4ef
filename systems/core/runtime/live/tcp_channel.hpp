// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <mutex>

#include "runtime/channel.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/live/socket.hpp"
#include "runtime/observer.hpp"

namespace slambed {

/// The queues of one channel between the workers and the network's I/O thread.
class TcpChannel final : public Channel {
 public:
  TcpChannel(LiveRuntime& runtime, Observer& observer, ChannelOptions options,
             std::function<void()> wake_io);

  const ChannelOptions& options() const override { return options_; }
  std::uint64_t send(std::uint8_t type, Bytes payload) override;
  void hold(bool held) override;
  std::optional<Message> try_receive() override;
  Signal& signal() override { return *signal_; }
  PathStats path() const override;

  // For the I/O thread.
  std::optional<Message> next_to_send();
  /// Puts back a message that a broken connection did not write completely, to be sent first on the
  /// next one. Messages that the kernel took completely are not repeated.
  void put_back(Message message);
  /// Returns false for a message that was received before (repeated after a reconnect).
  bool deliver(Message message);
  /// Sets the fd of the established connection, or -1. The fd must stay open until then.
  void set_connection(int fd);
  /// Call for a restarted peer, whose sequences start at 1 again.
  void forget_peer_sequence();
  bool idle() const;  ///< no message is to be sent now

  void record_link(std::string_view event, std::string_view detail) const;

 private:
  void record(const Message& message, bool incoming, bool dropped) const;

  LiveRuntime& runtime_;
  Observer& observer_;
  ChannelOptions options_;
  std::function<void()> wake_io_;
  std::unique_ptr<Signal> signal_;

  mutable std::mutex mutex_;  ///< guards what follows
  std::deque<Message> outgoing_, incoming_;
  std::uint64_t next_sequence_ = 1;
  std::uint64_t last_received_ = 0;
  bool held_ = false;
  int fd_ = -1;
  std::uint64_t connections_ = 0;
};

}  // namespace slambed
