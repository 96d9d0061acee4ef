// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <span>
#include <vector>

#include "link/direction.hpp"
#include "packet_log.hpp"
#include "tun.hpp"

namespace slambed::relay {

using link::Admission;
using link::DirectionModel;
using link::DirectionOptions;
using link::Fate;

/// What one direction did, for the summary.
struct PipeCounters {
  std::int64_t packets = 0;
  std::int64_t bytes = 0;
  std::int64_t fates[5] = {};     ///< by Fate
  std::int64_t write_errors = 0;  ///< the receiver's device refused a packet
  std::int64_t late_ns_max = 0;   ///< worst time beyond due
  std::int64_t held_bytes_max = 0;
};

/// Moves packets of one direction from one device to the other, each at its due time, in order.
class Pipe {
 public:
  static constexpr std::int64_t kNothingDue = std::numeric_limits<std::int64_t>::max();

  Pipe(const DirectionOptions& options, std::uint64_t seed, std::uint8_t direction, int from,
       int to, PacketLog& log);

  DirectionModel& model() { return model_; }

  /// Reads up to `budget` packets. Returns how many there were.
  /// Throws Error with code kPeer when the device is gone.
  int take(int budget, std::span<std::uint8_t> buffer);

  /// Hands over everything that is due.
  void deliver_due();

  std::int64_t next_due_ns() const {
    return held_.empty() ? kNothingDue : held_.front().record.due_ns;
  }
  const PipeCounters& counters() const { return counters_; }

 private:
  struct Held {
    PacketRecord record;
    std::vector<std::uint8_t> bytes;
  };

  void accept(std::span<const std::uint8_t> packet);
  void hand_over(PacketRecord& record, std::span<const std::uint8_t> packet);
  std::vector<std::uint8_t> copy(std::span<const std::uint8_t> packet);

  DirectionModel model_;
  std::uint8_t direction_;
  int from_;
  int to_;
  PacketLog& log_;
  std::deque<Held> held_;
  std::vector<std::vector<std::uint8_t>> spare_;  ///< buffers to use again
  std::int64_t held_bytes_ = 0;
  PipeCounters counters_;
};

}  // namespace slambed::relay
