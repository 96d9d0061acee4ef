// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "node/completion.hpp"
#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

/// Sends keyframes with all points they see, so that each can be understood without those before
/// it. What leaves is how the map was at send(); writing it is done on a worker of its own.
class WholeKeyFrameSender {
 public:
  /// filled: size in bytes that smaller messages are filled up to; 0: sent as they are.
  WholeKeyFrameSender(MobileNode& node, Channel& channel, MessageCodec codec, std::size_t filled);

  void start();
  /// type: wire::MessageType; about: fields of the event, which gets the sizes.
  void send(wire::MessageType type, KeyFrameId keyframe, RunTime captured, JsonLine about);
  /// All that was given is with the channel.
  Completion written();
  /// Of the last message on the channel, 0 when there was none.
  std::uint64_t last_sequence() const { return last_sequence_; }

 private:
  struct Item {
    wire::MessageType type = wire::kKeyFrame;
    wire::KeyFrameMessage message;
    JsonLine about;
  };
  void work(Worker& worker);

  MobileNode& node_;
  Channel& channel_;
  MessageCodec codec_;
  std::size_t filled_;
  Mailbox<Item> queue_;
  std::unique_ptr<Signal> written_;
  std::atomic<int> open_{0};
  std::atomic<std::uint64_t> last_sequence_{0};
};

}  // namespace slambed
