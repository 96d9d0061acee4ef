// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string_view>

#include "node/edge_node.hpp"
#include "offload/channels/message_codec.hpp"

namespace slambed {

/// A keyframe that the edge admits, with its timestamps so far.
struct AdmittedKeyFrame {
  wire::KeyFrameMessage message;
  wire::UpdateTimes times;
};

/// Decides about keyframes that arrive at an edge. All calls come from the receiving worker.
class KeyFrameRecipient {
 public:
  virtual ~KeyFrameRecipient() = default;
  /// Called for every keyframe that could be parsed, admitted or not.
  virtual void received(const wire::KeyFrameMessage&) = 0;
  /// Returns the reason why the keyframe is declined, or nothing.
  virtual std::optional<std::string_view> keyframe_decline_reason(
      const wire::KeyFrameMessage& message) const = 0;
  virtual void admit(Worker& worker, AdmittedKeyFrame keyframe) = 0;
};

/// Receives and parses keyframes on its own worker. By default it does not wait for the mapper.
class KeyFrameIntake {
 public:
  KeyFrameIntake(EdgeNode& node, Channel& channel, MessageCodec codec,
                 KeyFrameRecipient& recipient);

  /// Answers keyframes that cannot start a map with KEYFRAME_WANTED. Call before start().
  void ask_when_empty() { asks_ = true; }
  /// Leaves keyframes in the queue of the channel unless the mapper is idle or look() was called.
  /// Call before start().
  void wait_for_mapper(std::function<bool()> idle) { idle_ = std::move(idle); }
  /// Takes one keyframe now, if any waits. Any worker may call it.
  void look();
  void start();
  /// Waits until the keyframe with this sequence has arrived, or until the deadline.
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
  std::function<bool()> idle_;  ///< not set: keyframes are read as they arrive
  std::atomic<bool> looks_{false};
  std::unique_ptr<Signal> received_;
  std::atomic<std::uint64_t> received_sequence_{0};
};

}  // namespace slambed
