// SPDX-License-Identifier: Apache-2.0
#include "link/rate.hpp"

#include <algorithm>
#include <utility>

namespace slambed::link {
namespace {

constexpr std::int64_t kOpportunityBytes = 1500;  // Mahimahi: one MTU-sized packet per line

}  // namespace

Bottleneck::Bottleneck(RateOptions options) : options_(std::move(options)) {}

std::int64_t Bottleneck::waiting_bytes(std::int64_t now_ns) {
  while (!waiting_.empty() && waiting_.front().at_ns <= now_ns) {
    waiting_bytes_ -= waiting_.front().bytes;
    waiting_.pop_front();
  }
  return waiting_bytes_;
}

void Bottleneck::set_origin(std::int64_t origin_ns) {
  origin_ns_ = origin_ns;
  next_index_ = 0;
  left_in_current_ = 0;
}

std::optional<std::int64_t> Bottleneck::admit(std::int64_t now_ns, std::uint32_t bytes) {
  if (waiting_bytes(now_ns) + bytes > options_.queue_bytes) return std::nullopt;
  const std::int64_t departure = depart(now_ns, bytes);
  waiting_.push_back({departure, bytes});
  waiting_bytes_ += bytes;
  return departure;
}

std::int64_t Bottleneck::probe_departure(std::int64_t now_ns, std::uint32_t bytes) {
  waiting_bytes(now_ns);
  const auto free_at_ns = free_at_ns_;
  const auto next_index = next_index_, left = left_in_current_;
  const std::int64_t departure = depart(now_ns, bytes);
  free_at_ns_ = free_at_ns;
  next_index_ = next_index;
  left_in_current_ = left;
  return departure;
}

std::int64_t Bottleneck::depart(std::int64_t now_ns, std::uint32_t bytes) {
  return options_.opportunities_ns.empty() ? depart_constant(now_ns, bytes)
                                           : depart_trace(now_ns, bytes);
}

std::int64_t Bottleneck::depart_constant(std::int64_t now_ns, std::uint32_t bytes) {
  const double wire_ns = 8.0 * bytes / options_.bits_per_s * kNsPerS;
  free_at_ns_ = std::max(free_at_ns_, now_ns) + static_cast<std::int64_t>(wire_ns);
  return free_at_ns_;
}

std::int64_t Bottleneck::opportunity(std::int64_t index) const {
  const auto count = static_cast<std::int64_t>(options_.opportunities_ns.size());
  return index / count * options_.period_ns +
         options_.opportunities_ns[static_cast<std::size_t>(index % count)];
}

std::int64_t Bottleneck::depart_trace(std::int64_t now_ns, std::uint32_t bytes) {
  const std::int64_t trace_time_ns = now_ns - origin_ns_;
  // An opportunity with an empty queue is lost. So is the rest of an opportunity when the queue
  // becomes empty.
  const auto count = static_cast<std::int64_t>(options_.opportunities_ns.size());
  if (opportunity(next_index_) < trace_time_ns) {
    const std::int64_t rounds = trace_time_ns / options_.period_ns;
    next_index_ = std::max(next_index_, rounds * count);
    while (opportunity(next_index_) < trace_time_ns) ++next_index_;
    left_in_current_ = 0;
  } else if (waiting_.empty()) {
    left_in_current_ = 0;
  }
  const auto needed = static_cast<std::int64_t>(bytes) - left_in_current_;
  if (needed <= 0) {
    left_in_current_ -= bytes;
    return std::max(now_ns, origin_ns_ + opportunity(next_index_ - 1));
  }
  const std::int64_t used = (needed + kOpportunityBytes - 1) / kOpportunityBytes;
  next_index_ += used;
  left_in_current_ = used * kOpportunityBytes - needed;
  return origin_ns_ + opportunity(next_index_ - 1);
}

}  // namespace slambed::link
