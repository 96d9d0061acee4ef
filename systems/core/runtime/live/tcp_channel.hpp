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

/// The queues of one channel: workers on one side, the network's I/O thread on the other.
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

  // The I/O thread's side.
  std::optional<Message> next_to_send();
  /// A message that a broken connection did not take whole goes first on the next one.
  /// What the kernel had taken whole is not repeated.
  void put_back(Message message);
  /// False for a message that came before (sent again after a reconnect).
  bool deliver(Message message);
  /// fd of the established connection, -1 when there is none. The fd stays open until set to -1.
  void set_connection(int fd);
  /// The peer counts its messages from 1 again when it was restarted.
  void forget_peer_sequence();
  bool idle() const;  ///< nothing is to be sent

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
