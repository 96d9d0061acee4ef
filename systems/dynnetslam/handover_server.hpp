// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>

#include "node/messaging.hpp"
#include "offload/edge/edge_mapping.hpp"
#include "runtime/mailbox.hpp"
#include "wire/handover_messages.hpp"

namespace slambed {

/// The other side of HandoverClient: answers STATE, lets mapping rest and go on, takes maps over.
/// What belongs to an older epoch than the last one heard of changes nothing.
class HandoverServer {
 public:
  HandoverServer(EdgeNode& node, EdgeMapping& mapping, Channel& channel);

  void start();

 private:
  void listen(Worker& worker);
  void stop(const wire::StopMessage& stop);
  /// Taking a map over may last: who listens must not wait for it.
  void work(Worker& worker);
  void begin(const wire::StartMessage& start);
  void apply(Worker& worker, const Message& raw);
  void resume(std::uint64_t epoch);
  /// True, and recorded, when the epoch is over.
  bool is_stale(std::uint64_t epoch, std::uint64_t number);
  void answer(std::uint64_t epoch, std::uint64_t number, wire::HandoverAnswer answer);

  EdgeNode& node_;
  EdgeMapping& mapping_;
  Channel& channel_;
  Inbox inbox_;
  Mailbox<Message> arrived_;  ///< START and MAP_HANDOVER
  std::mutex mutex_;          ///< orders the ends of mapping's rests with their beginnings
  std::uint64_t epoch_ = 0;
  std::uint64_t applied_ = 0;  ///< the merging worker's: number of the last hand-over taken over
};

}  // namespace slambed
