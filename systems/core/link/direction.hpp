// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "link/impairment.hpp"
#include "link/rate.hpp"
#include "link/schedule.hpp"

namespace slambed::link {

/// What happened to a packet. The numbers are written to the packet log.
enum class Fate : std::uint8_t {
  kDelivered = 0,
  kLost = 1,
  kQueueFull = 2,
  kInGap = 3,
  kOverflow = 4
};

struct DirectionOptions {
  std::vector<std::int64_t> delays_ns = {0};
  std::int64_t step_ns = 10'000'000;
  Interpolation interpolation = Interpolation::kLinear;
  std::optional<JitterOptions> jitter;
  std::optional<LossOptions> loss;
  std::optional<RateOptions> rate;
  std::vector<Gap> gaps;
  bool gap_drops = false;  ///< false: packets that would arrive in a gap wait for its end
};

struct PacketOutcome {
  Fate fate = Fate::kDelivered;
  std::int64_t due_ns = 0;       ///< when to deliver it, CLOCK_MONOTONIC
  std::int64_t profile_ns = 0;   ///< the profile's part of the delay
  std::int64_t queue_bytes = 0;  ///< backlog of the bottleneck before this packet
};

/// One direction of the link as a pure model of its delay, jitter, bandwidth and packet loss:
/// arrival time and size in, due time or drop out. Due times of a lane never decrease, so packets
/// cannot overtake one another when the delay falls.
class DirectionModel {
 public:
  DirectionModel(const DirectionOptions& options, std::uint64_t seed, std::uint64_t direction);

  /// Applies the profile's value at time 0 from now on. Before this call the link adds nothing.
  void apply_profile() { applied_ = true; }
  /// Sets run time 0 on CLOCK_MONOTONIC.
  void start(std::int64_t t0_ns) {
    applied_ = true;
    t0_ns_ = t0_ns;
  }

  /// Returns the profile's delay at a run time, without jitter, rate and gaps.
  std::int64_t profile_ns(std::int64_t run_time_ns) const { return schedule_.at(run_time_ns); }

  /// Decides when a packet arrives or why it is dropped. A probe waits behind the queue like any
  /// packet, but takes no space in it and does not affect the draws for data packets.
  /// @param now_ns CLOCK_MONOTONIC, not decreasing
  PacketOutcome admit(std::int64_t now_ns, std::uint32_t bytes, Lane lane = Lane::kData);

 private:
  void place_trace(std::int64_t now_ns);
  const Gap* gap_at(std::int64_t run_time_ns) const;
  std::int64_t run_time(std::int64_t now_ns) const { return t0_ns_ ? now_ns - *t0_ns_ : 0; }

  struct LaneState {
    std::optional<JitterModel> jitter;
    std::optional<LossModel> loss;
    std::int64_t last_due_ns = 0;
  };

  DelaySchedule schedule_;
  std::array<LaneState, 2> lanes_;
  std::optional<Bottleneck> bottleneck_;
  std::vector<Gap> gaps_;
  bool gap_drops_;
  bool applied_ = false;
  std::optional<std::int64_t> t0_ns_;
  std::optional<std::int64_t> trace_origin_ns_;
};

}  // namespace slambed::link
