// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/tcp_cubic.hpp"

#include <algorithm>

#include "base/portable_math.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

// Linux, net/ipv4/tcp_cubic.c: beta 717/1024, C 0.4 segments/s^3.
constexpr double kBeta = 717.0 / 1024, kScale = 0.4;
constexpr double kLeastHyStartWindow = 16;
constexpr int kHyStartSamples = 8;
constexpr Duration kAckSpacing = 2ms, kLeastDelayRise = 4ms, kMostDelayRise = 16ms;

}  // namespace

double TcpCubic::reduced() {
  in_epoch_ = false;
  // Fast convergence: a window that did not reach the last plateau leaves bandwidth to other flows.
  last_most_ = window < last_most_ ? window * (1 + kBeta) / 2 : window;
  return std::max(window * kBeta, 2.0);
}

void TcpCubic::grow(double segments, RunTime now, Duration rtt) {
  if (slow_start()) {
    const double room = slow_start_limit - window;
    window += std::min(segments, room);
    segments -= std::min(segments, room);
  }
  if (segments > 0) window += segments / wanted_acks(now, rtt);
}

double TcpCubic::wanted_acks(RunTime now, Duration rtt) {
  if (!in_epoch_) {
    in_epoch_ = true;
    epoch_ = now;
    estimate_ = window;
    origin_ = std::max(window, last_most_);
    const double climb = (origin_ - window) / kScale;
    to_origin_ = climb > 0 ? from_seconds(portable::pow(climb, 1.0 / 3)) : Duration(0);
  }
  const double t = to_seconds(now - epoch_ + std::min(least_rtt_, rtt) - to_origin_);
  const double target = origin_ + kScale * t * t * t;
  double acks = target > window ? window / (target - window) : 100 * window;
  if (last_most_ == 0) acks = std::min(acks, 20.0);
  // Grow at least as fast as Reno with this beta.
  estimate_ += 3 * (1 - kBeta) / (1 + kBeta) / window;
  if (estimate_ > window) acks = std::min(acks, window / (estimate_ - window));
  return std::max(acks, 2.0);
}

void TcpCubic::sample_rtt(Duration rtt, RunTime now, std::uint64_t acknowledged,
                          std::uint64_t next) {
  least_rtt_ = std::min(least_rtt_, rtt);
  if (!slow_start()) return;
  if (acknowledged > round_end_ || round_end_ == 0) {
    round_end_ = next;
    round_begin_ = last_ack_ = now;
    round_rtt_ = Duration::max();
    samples_ = 0;
  }
  if (window < kLeastHyStartWindow) return;
  bool full = false;
  if (now - last_ack_ <= kAckSpacing) {
    last_ack_ = now;
    full = now - round_begin_ > least_rtt_ / 2;
  }
  round_rtt_ = std::min(round_rtt_, rtt);
  if (samples_ < kHyStartSamples) {
    ++samples_;
  } else {
    full |= round_rtt_ > least_rtt_ + std::clamp(least_rtt_ / 8, kLeastDelayRise, kMostDelayRise);
  }
  if (full) slow_start_limit = window;
}

void TcpCubic::idle(Duration time) {
  if (in_epoch_) epoch_ += time;
}

}  // namespace slambed
