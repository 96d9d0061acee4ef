// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "edgeslam_semantic/link_delay.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "node/mobile_node.hpp"
#include "runtime/mailbox.hpp"

namespace slambed::edgeslam_semantic {

/// Uploads keyframes on one worker and measures the link with probes on another.
class Uploads {
 public:
  struct Options {
    bool pictures;
    bool one_way;  ///< see LinkDelay
    double probe_period_s;
  };
  /// What the log says about a keyframe when it is sent.
  struct Note {
    std::string_view reason;
    int row = 0, levels = 0;
  };

  Uploads(MobileNode& node, Channel& frames, Channel& probes, Options options);

  void start();
  /// Queues an upload without blocking.
  void put(SemanticKeyFrame message, Note note);
  /// Notes the edge's acknowledgment of an upload.
  void acknowledged(const wire::AckMessage& ack, RunTime when);
  /// Returns the keyframe uploaded under this sequence number, or nothing if it is not among the
  /// newest.
  std::optional<KeyFrameId> keyframe_of(std::uint64_t sequence) const;
  std::optional<Duration> delay() const { return delay_.delay(); }
  /// Waits until the channel has got all queued uploads, at most 5 s.
  void drain(Worker& worker);
  std::uint64_t last_sequence() const { return last_sequence_; }

 private:
  struct Item {
    SemanticKeyFrame message;
    Note note;
  };
  void send(Worker& worker);
  void probe(Worker& worker);
  void remember(std::uint64_t sequence, KeyFrameId keyframe);

  MobileNode& node_;
  Channel &frames_, &probes_;
  Options options_;
  LinkDelay delay_;
  Mailbox<Item> queue_;
  std::unique_ptr<Signal> gone_;
  mutable std::mutex numbers_mutex_;
  std::deque<std::pair<std::uint64_t, KeyFrameId>> numbers_;  ///< the newest uploads
  std::atomic<std::uint64_t> put_{0}, sent_{0}, last_sequence_{0};
};

}  // namespace slambed::edgeslam_semantic
