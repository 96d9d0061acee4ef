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

/// A channel on top of another that sends as Edge-SLAM does: the length of a message goes ahead
/// (ANNOUNCE) and is acknowledged, then the message, which is acknowledged before the next one may
/// go. So each message takes a round trip before its first byte and one behind its last. A transfer
/// that a broken connection interrupted begins again; nothing is delivered twice.
///
/// The channel below must have unlimited queues. The limits are kept here: the oldest waiting
/// message is dropped.
class StopAndWaitChannel final : public Channel {
 public:
  StopAndWaitChannel(Runtime& runtime, Observer& observer, Channel& below, ChannelOptions options);

  /// Spawns the worker that answers and waits.
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
  std::uint64_t next_sequence_ = 1;

  // The worker's.
  Phase phase_ = Phase::kIdle;
  Message current_;               ///< on its way
  std::uint64_t connection_ = 0;  ///< on which current_ was announced
  std::optional<wire::AnnounceMessage> announced_;
  std::uint64_t last_delivered_ = 0, session_ = 0;
};

}  // namespace slambed
