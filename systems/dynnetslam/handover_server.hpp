// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>

#include "node/messaging.hpp"
#include "offload/edge/edge_mapping.hpp"
#include "runtime/mailbox.hpp"
#include "wire/handover_messages.hpp"

namespace slambed {

/// The edge's side of HandoverClient: answers STATE, pauses and resumes mapping, and merges maps.
/// Ignores messages of an older epoch than the latest one received.
class HandoverServer {
 public:
  HandoverServer(EdgeNode& node, EdgeMapping& mapping, Channel& channel);

  void start();

 private:
  void listen(Worker& worker);
  void stop(const wire::StopMessage& stop);
  /// Merges maps on a separate worker: it may take long, and the listening worker must not wait.
  void work(Worker& worker);
  void begin(const wire::StartMessage& start);
  void apply(Worker& worker, const Message& raw);
  void resume(std::uint64_t epoch);
  /// Returns whether the epoch is over; if so, logs it.
  bool is_stale(std::uint64_t epoch, std::uint64_t number);
  void answer(std::uint64_t epoch, std::uint64_t number, wire::HandoverAnswer answer);

  EdgeNode& node_;
  EdgeMapping& mapping_;
  Channel& channel_;
  Inbox inbox_;
  Mailbox<Message> arrived_;  ///< START and MAP_HANDOVER
  std::mutex mutex_;          ///< orders pauses and resumes of mapping
  std::uint64_t epoch_ = 0;
  std::uint64_t applied_ = 0;  ///< merging worker only: number of the last merged hand-over
};

}  // namespace slambed
