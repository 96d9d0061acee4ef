// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <span>
#include <vector>

#include "apps/relay/packet_log.hpp"
#include "apps/relay/tun.hpp"
#include "link/direction.hpp"

namespace slambed::relay {

using link::DirectionModel;
using link::DirectionOptions;
using link::Fate;
using link::PacketOutcome;

/// Counters of one direction for the summary.
struct PipeCounters {
  std::int64_t packets = 0;
  std::int64_t bytes = 0;
  std::int64_t fates[5] = {};     ///< by Fate
  std::int64_t write_errors = 0;  ///< packets that the receiver's device refused
  std::int64_t late_ns_max = 0;   ///< largest delay after the due time
  std::int64_t held_bytes_max = 0;
};

/// Moves packets of one direction from one device to the other, in order, each at its due time.
/// ICMP echoes belong to the probe, so they have their own lane and delay no other packets.
class Pipe {
 public:
  static constexpr std::int64_t kNothingDue = std::numeric_limits<std::int64_t>::max();

  Pipe(const DirectionOptions& options, std::uint64_t seed, std::uint8_t direction, int from,
       int to, PacketLog& log);

  DirectionModel& model() { return model_; }

  /// Reads up to `budget` packets and returns how many there were.
  /// Throws Error with code kPeer if the device is gone.
  int take(int budget, std::span<std::uint8_t> buffer);

  /// Delivers all packets that are due.
  void deliver_due();

  std::int64_t next_due_ns() const {
    std::int64_t next_ns = kNothingDue;
    for (const auto& lane : held_) {
      if (!lane.empty()) next_ns = std::min(next_ns, lane.front().record.due_ns);
    }
    return next_ns;
  }
  const PipeCounters& counters() const { return counters_; }

 private:
  struct Held {
    PacketRecord record;
    std::vector<std::uint8_t> bytes;
  };

  void deliver_due(std::deque<Held>& lane);
  void accept(std::span<const std::uint8_t> packet);
  void hand_over(PacketRecord& record, std::span<const std::uint8_t> packet);
  std::vector<std::uint8_t> copy(std::span<const std::uint8_t> packet);

  DirectionModel model_;
  std::uint8_t direction_;
  int from_;
  int to_;
  PacketLog& log_;
  std::array<std::deque<Held>, 2> held_;          ///< by link::Lane, each ordered by due time
  std::vector<std::vector<std::uint8_t>> spare_;  ///< buffers to reuse
  std::int64_t held_bytes_ = 0;
  PipeCounters counters_;
};

}  // namespace slambed::relay
