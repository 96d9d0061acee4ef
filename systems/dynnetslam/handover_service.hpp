// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/edge_mapping.hpp"
#include "wire/handover_messages.hpp"

namespace slambed::dynnetslam {

/// The edge's side of EdgeContact: answers STATE, lets mapping rest and go on, takes maps over. What
/// belongs to an older epoch than the last one heard of changes nothing.
class HandoverService {
 public:
  HandoverService(EdgeNode& node, EdgeMapping& mapping, Channel& channel)
      : node_(node), mapping_(mapping), channel_(channel) {}

  void start();

 private:
  void serve(Worker& worker);
  void take(Worker& worker, const Message& message);
  void stop(const wire::StopMessage& stop);
  void begin(Worker& worker, const wire::StartMessage& start);
  void take_over(Worker& worker, const Message& raw);
  /// True, and recorded, when the epoch is over.
  bool is_stale(std::uint64_t epoch, std::uint64_t number);
  void answer(std::uint64_t epoch, std::uint64_t number, bool accepted);

  EdgeNode& node_;
  EdgeMapping& mapping_;
  Channel& channel_;
  std::uint64_t epoch_ = 0;
};

}  // namespace slambed::dynnetslam
