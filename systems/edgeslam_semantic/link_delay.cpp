// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/link_delay.hpp"

#include <algorithm>
#include <numeric>

namespace slambed::edgeslam_semantic {
namespace {

/// A new sample has a weight of 1/8 (RFC 6298, as in the kernel).
constexpr int kSmoothing = 8;
/// Uploads are rare: with a weight of 1/8, a change of rate would show some ten uploads late.
constexpr double kRateSmoothing = 2;
constexpr std::size_t kSizes = 5;
/// Most unacknowledged uploads that are tracked; the oldest is dropped first.
constexpr std::size_t kMostUnderWay = 64;

}  // namespace

void LinkDelay::probed(Duration round_trip) {
  const std::lock_guard lock(mutex_);
  round_trip_ = round_trip_ ? *round_trip_ + (round_trip - *round_trip_) / kSmoothing : round_trip;
}

void LinkDelay::going(std::size_t bytes, RunTime when) {
  const std::lock_guard lock(mutex_);
  going_ = {bytes, when, !under_way_.empty()};
  sizes_.push_back(bytes);
  if (sizes_.size() > kSizes) sizes_.pop_front();
}

void LinkDelay::numbered(std::uint64_t sequence) {
  const std::lock_guard lock(mutex_);
  if (!going_) return;
  under_way_[sequence] = *going_;
  if (under_way_.size() > kMostUnderWay) under_way_.erase(under_way_.begin());
  going_.reset();
  const auto early = answered_early_.find(sequence);
  if (early != answered_early_.end()) acknowledged_locked(sequence, early->second);
  answered_early_.clear();
}

void LinkDelay::acknowledged(std::uint64_t sequence, RunTime when) {
  const std::lock_guard lock(mutex_);
  acknowledged_locked(sequence, when);
}

void LinkDelay::acknowledged_locked(std::uint64_t sequence, RunTime when) {
  const auto found = under_way_.find(sequence);
  if (found == under_way_.end()) {
    if (going_ && answered_early_.size() < kMostUnderWay) answered_early_.emplace(sequence, when);
    return;
  }
  const Upload upload = found->second;
  under_way_.erase(under_way_.begin(), std::next(found));
  // Back-to-back uploads are acknowledged one transmission time apart. A lone upload is
  // acknowledged after its transmission time plus one RTT.
  std::optional<Duration> took;
  if (upload.behind && last_acknowledged_ > upload.sent) {
    took = when - last_acknowledged_;
  } else if (round_trip_) {
    took = when - upload.sent - *round_trip_;
  }
  last_acknowledged_ = when;
  if (!took || upload.bytes == 0) return;
  const double sample = std::max(to_seconds(*took), 0.0) / static_cast<double>(upload.bytes);
  seconds_per_byte_ = seconds_per_byte_
                          ? *seconds_per_byte_ + (sample - *seconds_per_byte_) / kRateSmoothing
                          : sample;
}

std::optional<Duration> LinkDelay::round_trip() const {
  const std::lock_guard lock(mutex_);
  return round_trip_;
}

std::optional<double> LinkDelay::bytes_per_s() const {
  const std::lock_guard lock(mutex_);
  if (!seconds_per_byte_ || *seconds_per_byte_ <= 0) return std::nullopt;
  return 1 / *seconds_per_byte_;
}

double LinkDelay::mean_bytes_locked() const {
  if (sizes_.empty()) return 0;
  return std::accumulate(sizes_.begin(), sizes_.end(), 0.0) / static_cast<double>(sizes_.size());
}

double LinkDelay::mean_bytes() const {
  const std::lock_guard lock(mutex_);
  return mean_bytes_locked();
}

std::optional<Duration> LinkDelay::delay() const {
  const std::lock_guard lock(mutex_);
  if (!round_trip_ || !seconds_per_byte_) return std::nullopt;
  const Duration latency = one_way_ ? *round_trip_ / 2 : *round_trip_;
  return latency + from_seconds(mean_bytes_locked() * *seconds_per_byte_);
}

}  // namespace slambed::edgeslam_semantic
