// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "node/completion.hpp"
#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

/// Sends keyframes with all points they see, so that each can be read without the earlier ones.
/// Each is sent as it was at send(); a separate worker serializes it.
class WholeKeyFrameSender {
 public:
  /// filled: smaller messages are padded to this size in bytes; 0: no padding.
  WholeKeyFrameSender(MobileNode& node, Channel& channel, MessageCodec codec, std::size_t filled);

  void start();
  /// about: the event to log, to which the sizes are added.
  void send(wire::MessageType type, KeyFrameId keyframe, RunTime captured, JsonLine about);
  /// Completes when the channel has all keyframes.
  Completion written();
  /// Sequence of the last message on the channel; 0: none.
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
