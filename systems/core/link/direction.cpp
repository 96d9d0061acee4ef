// SPDX-License-Identifier: Apache-2.0
#include "link/direction.hpp"

#include <algorithm>

namespace slambed::link {

DirectionModel::DirectionModel(const DirectionOptions& options, std::uint64_t seed,
                               std::uint64_t direction)
    : schedule_(options.delays_ns, options.step_ns, options.interpolation),
      gaps_(options.gaps),
      gap_drops_(options.gap_drops) {
  if (options.jitter) jitter_.emplace(*options.jitter, seed, direction);
  if (options.loss) loss_.emplace(*options.loss, seed, direction);
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

Admission DirectionModel::admit(std::int64_t now_ns, std::uint32_t bytes) {
  Admission result;
  if (!applied_) {
    result.due_ns = last_due_ns_ = std::max(last_due_ns_, now_ns);
    return result;
  }
  // Drawn for every packet, dropped elsewhere or not: the n-th packet's luck depends on n alone.
  const bool lost = loss_ && loss_->drop();
  const std::int64_t extra_ns = jitter_ ? jitter_->draw(now_ns) : 0;
  if (lost) {
    result.fate = Fate::kLost;
    return result;
  }
  std::int64_t leaves_ns = now_ns;
  if (bottleneck_) {
    place_trace(now_ns);
    result.queue_bytes = bottleneck_->waiting_bytes(now_ns);
    const auto departure = bottleneck_->admit(now_ns, bytes);
    if (!departure) {
      result.fate = Fate::kQueueFull;
      return result;
    }
    leaves_ns = *departure;
  }
  result.profile_ns = schedule_.at(run_time(leaves_ns));
  std::int64_t due_ns = leaves_ns + std::max<std::int64_t>(0, result.profile_ns + extra_ns);
  if (const Gap* gap = gap_at(run_time(due_ns))) {
    if (gap_drops_) {
      result.fate = Fate::kInGap;
      return result;
    }
    due_ns = *t0_ns_ + gap->end_ns;
  }
  result.due_ns = last_due_ns_ = std::max(last_due_ns_, due_ns);
  return result;
}

}  // namespace slambed::link
