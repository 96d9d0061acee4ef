// SPDX-License-Identifier: Apache-2.0
#include "link/direction.hpp"

#include <algorithm>

namespace slambed::link {

DirectionModel::DirectionModel(const DirectionOptions& options, std::uint64_t seed,
                               std::uint64_t direction)
    : schedule_(options.delays_ns, options.step_ns, options.interpolation),
      gaps_(options.gaps),
      gap_drops_(options.gap_drops) {
  for (const Lane lane : {Lane::kData, Lane::kProbe}) {
    LaneState& state = lanes_[static_cast<std::size_t>(lane)];
    if (options.jitter) state.jitter.emplace(*options.jitter, seed, direction, lane);
    if (options.loss) state.loss.emplace(*options.loss, seed, direction, lane);
  }
  if (options.rate) bottleneck_.emplace(*options.rate);
}

const Gap* DirectionModel::gap_at(std::int64_t run_time_ns) const {
  if (!t0_ns_) return nullptr;
  for (const Gap& gap : gaps_) {
    if (run_time_ns >= gap.start_ns && run_time_ns < gap.end_ns) return &gap;
  }
  return nullptr;
}

void DirectionModel::place_trace(std::int64_t now_ns) {
  const bool running = t0_ns_ && now_ns >= *t0_ns_;
  const std::int64_t origin_ns = running ? *t0_ns_ : trace_origin_ns_.value_or(now_ns);
  if (trace_origin_ns_ == origin_ns) return;
  trace_origin_ns_ = origin_ns;
  bottleneck_->set_origin(origin_ns);
}

PacketOutcome DirectionModel::admit(std::int64_t now_ns, std::uint32_t bytes, Lane lane) {
  PacketOutcome result;
  LaneState& own = lanes_[static_cast<std::size_t>(lane)];
  if (!applied_) {
    result.due_ns = own.last_due_ns = std::max(own.last_due_ns, now_ns);
    return result;
  }
  // Drawn for every packet, even if it is dropped for another reason: the draws of the n-th packet
  // depend only on n (and, with bursts in time, on the time).
  const bool lost = own.loss && own.loss->drop(t0_ns_ ? now_ns - *t0_ns_ : -1);
  const std::int64_t extra_ns = own.jitter ? own.jitter->draw(now_ns) : 0;
  if (lost) {
    result.fate = Fate::kLost;
    return result;
  }
  std::int64_t leaves_ns = now_ns;
  if (bottleneck_) {
    place_trace(now_ns);
    result.queue_bytes = bottleneck_->waiting_bytes(now_ns);
    const std::optional<std::int64_t> departure = lane == Lane::kProbe
                                                      ? bottleneck_->probe_departure(now_ns, bytes)
                                                      : bottleneck_->admit(now_ns, bytes);
    if (!departure) {
      result.fate = Fate::kQueueFull;
      return result;
    }
    leaves_ns = *departure;
  }
  result.profile_ns = schedule_.at(run_time(leaves_ns));
  std::int64_t due_ns = leaves_ns + std::max<std::int64_t>(0, result.profile_ns + extra_ns);
  // The end of one outage may lie within another.
  while (const Gap* gap = gap_at(run_time(due_ns))) {
    if (gap_drops_) {
      result.fate = Fate::kInGap;
      return result;
    }
    due_ns = *t0_ns_ + gap->end_ns;
  }
  result.due_ns = own.last_due_ns = std::max(own.last_due_ns, due_ns);
  return result;
}

}  // namespace slambed::link
