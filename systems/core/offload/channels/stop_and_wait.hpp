// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>

#include "runtime/channel.hpp"
#include "runtime/observer.hpp"
#include "wire/messages.hpp"

namespace slambed {

/// Sends as Edge-SLAM does, on top of another channel: the length of a message goes first
/// (ANNOUNCE), and the message follows once that is acknowledged. The next message waits until this
/// one is acknowledged. So each message costs one round trip before its first byte and one after
/// its last. A transfer that a broken connection interrupted starts over; no message is delivered
/// twice.
///
/// The channel below must have unlimited queues. The limits apply here: a full queue drops its
/// oldest message.
class StopAndWaitChannel final : public Channel {
 public:
  StopAndWaitChannel(Runtime& runtime, Observer& observer, Channel& below, ChannelOptions options);

  /// Spawns the worker that sends, acknowledges and waits for acknowledgments.
  void start();

  const ChannelOptions& options() const override { return options_; }
  std::uint64_t send(std::uint8_t type, Bytes payload) override;
  void hold(bool held) override;
  std::optional<Message> try_receive() override;
  Signal& signal() override { return *signal_; }
  PathStats path() const override;

 private:
  enum class Phase { kIdle, kAnnounced, kSent };

  void run(Worker& worker);
  void on_message(Message message);
  void on_ack(std::uint64_t code);
  void deliver(Message message);
  void begin_next();
  void announce();
  void set_announced_bytes(std::uint64_t bytes);
  void acknowledge(std::uint64_t sequence, bool whole);
  void record_drop(const Message& message, bool incoming) const;

  Runtime& runtime_;
  Observer& observer_;
  Channel& below_;
  ChannelOptions options_;
  std::unique_ptr<Signal> signal_;

  mutable std::mutex mutex_;  ///< guards what follows
  std::deque<Message> outgoing_, incoming_;
  bool held_ = false;
  /// Of the message whose length is announced, and which the channel below does not have yet.
  std::uint64_t announced_bytes_ = 0;
  std::uint64_t next_sequence_ = 1;

  // Used by the worker only.
  Phase phase_ = Phase::kIdle;
  Message current_;               ///< the message in transfer
  std::uint64_t connection_ = 0;  ///< on which current_ was announced
  std::optional<wire::AnnounceMessage> announced_;
  std::uint64_t last_delivered_ = 0, session_ = 0;
};

}  // namespace slambed
