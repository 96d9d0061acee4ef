// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string_view>

#include "node/edge_node.hpp"
#include "offload/channels/message_codec.hpp"

namespace slambed {

/// A keyframe that the edge admits, and when it passed each place until then.
struct AdmittedKeyFrame {
  wire::KeyFrameMessage message;
  wire::UpdateTimes times;
};

/// Who takes keyframes in at an edge. All on the receiving worker.
class KeyFrameRecipient {
 public:
  virtual ~KeyFrameRecipient() = default;
  /// Every keyframe that could be read, wanted or not.
  virtual void received(const wire::KeyFrameMessage&) = 0;
  /// The reason why it is declined, or nothing.
  virtual std::optional<std::string_view> keyframe_decline_reason(
      const wire::KeyFrameMessage& message) const = 0;
  virtual void admit(Worker& worker, AdmittedKeyFrame keyframe) = 0;
};

/// Receives and parses keyframes on a worker of its own, which waits for nobody.
class KeyFrameIntake {
 public:
  KeyFrameIntake(EdgeNode& node, Channel& channel, MessageCodec codec,
                 KeyFrameRecipient& recipient);

  /// Answers keyframes that no map can start with by KEYFRAME_WANTED. Before start().
  void ask_when_empty() { asks_ = true; }
  /// Leaves keyframes unread, in the queue of the channel, until the mapper looks for one: while it
  /// is idle, and whenever look() is called. Before start().
  void wait_for_mapper(std::function<bool()> idle) { idle_ = std::move(idle); }
  /// The mapper looks, from any worker: takes what waits now, if anything does.
  void look();
  void start();
  /// Waits until the keyframe with this sequence has come, or until the deadline.
  void wait_for(Worker& worker, std::uint64_t sequence, RunTime deadline);

 private:
  void receive(Worker& worker);
  std::optional<Message> next(Worker& worker);
  void on_keyframe(Worker& worker, const Message& raw);

  EdgeNode& node_;
  Channel& channel_;
  MessageCodec codec_;
  KeyFrameRecipient& recipient_;
  bool asks_ = false;
  std::function<bool()> idle_;  ///< not set: keyframes are read as they come
  std::atomic<bool> looks_{false};
  std::unique_ptr<Signal> received_;
  std::atomic<std::uint64_t> received_sequence_{0};
};

}  // namespace slambed
