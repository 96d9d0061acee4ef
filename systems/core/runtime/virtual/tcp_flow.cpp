// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/tcp_flow.hpp"

#include <algorithm>
#include <utility>

namespace slambed {
namespace {

constexpr double kInitialWindow = 10.0 * TcpFlow::kSegmentBytes;
constexpr int kDuplicatesForLoss = 3;
// Linux bounds the part for the variation, RFC 6298 the whole (1 s).
constexpr Duration kLeastVariation = std::chrono::milliseconds(200);
constexpr Duration kMaxTimeout = std::chrono::seconds(120);

}  // namespace

TcpFlow::TcpFlow(Simulator& simulator, PathModel& data_path, PathModel& ack_path,
                 std::function<void(std::uint64_t)> on_delivered,
                 std::function<void()> on_acknowledged)
    : simulator_(simulator),
      data_path_(data_path),
      ack_path_(ack_path),
      on_delivered_(std::move(on_delivered)),
      on_acknowledged_(std::move(on_acknowledged)) {}

void TcpFlow::write(std::uint64_t bytes) {
  if (next_ == acknowledged_) close_window_after(simulator_.now() - last_sent_);
  written_ += bytes;
  pump();
}

void TcpFlow::close_window_after(Duration idle) {
  if (idle <= timeout()) return;
  slow_start_limit_ = std::max(slow_start_limit_, 0.75 * window_);
  for (idle -= timeout(); idle > Duration(0) && window_ > kInitialWindow; idle -= timeout()) {
    window_ = std::max(window_ / 2, kInitialWindow);
  }
}

void TcpFlow::pump() {
  while (next_ < written_) {
    const double in_flight = static_cast<double>(next_ - acknowledged_);
    if (in_flight > 0 && in_flight + kSegmentBytes > window_) break;
    const std::uint64_t from = next_;
    next_ = std::min(written_, next_ + kSegmentBytes);
    send_segment(from);
  }
}

void TcpFlow::send_segment(std::uint64_t from) {
  const std::uint64_t to = std::min(next_, from + kSegmentBytes);
  const RunTime stamp = simulator_.now();
  if (unacknowledged() > 0 && timer_ == 0) arm_timer();
  last_sent_ = stamp;
  data_path_.transmit(static_cast<std::uint32_t>(to - from) + kHeaderBytes,
                      [this, from, to, stamp] { arrive(from, to, stamp); });
}

void TcpFlow::arrive(std::uint64_t from, std::uint64_t to, RunTime stamp) {
  const std::uint64_t before = received_;
  if (to > received_) {
    auto& end = early_[from];
    end = std::max(end, to);
    for (auto piece = early_.begin(); piece != early_.end() && piece->first <= received_;
         piece = early_.erase(piece)) {
      received_ = std::max(received_, piece->second);
    }
  }
  ack_path_.transmit(kHeaderBytes, [this, upto = received_, stamp] { acknowledge(upto, stamp); });
  if (received_ > before) on_delivered_(received_);
}

void TcpFlow::acknowledge(std::uint64_t upto, RunTime stamp) {
  if (upto > acknowledged_) {
    const double newly = static_cast<double>(upto - acknowledged_);
    acknowledged_ = upto;
    duplicates_ = 0;
    backoff_ = 0;
    sample(simulator_.now() - stamp);
    if (recovery_end_ && upto < *recovery_end_) {
      ++retransmissions_;  // partial acknowledgement: the next hole (RFC 6582)
      send_segment(acknowledged_);
    } else {
      recovery_end_.reset();
      const bool slow_start = window_ < slow_start_limit_;
      window_ += slow_start ? newly : kSegmentBytes * newly / window_;
    }
    timer_ = 0;
    if (unacknowledged() > 0) arm_timer();
    pump();
    on_acknowledged_();
  } else if (unacknowledged() > 0 && ++duplicates_ == kDuplicatesForLoss && !recovery_end_) {
    slow_start_limit_ = std::max(static_cast<double>(unacknowledged()) / 2, 2.0 * kSegmentBytes);
    window_ = slow_start_limit_;
    recovery_end_ = next_;
    ++retransmissions_;
    send_segment(acknowledged_);
  }
}

void TcpFlow::arm_timer() {
  // An older timer finds another number here and does nothing.
  timer_ = ++armed_;
  simulator_.at(simulator_.now() + timeout(), [this, mine = timer_] {
    if (timer_ == mine) time_out();
  });
}

void TcpFlow::time_out() {
  slow_start_limit_ = std::max(static_cast<double>(unacknowledged()) / 2, 2.0 * kSegmentBytes);
  window_ = kSegmentBytes;
  recovery_end_ = next_;
  ++backoff_;
  ++retransmissions_;
  timer_ = 0;
  send_segment(acknowledged_);
}

void TcpFlow::sample(Duration rtt) {
  if (srtt_ == Duration::zero()) {
    srtt_ = rtt;
    rtt_variation_ = rtt / 2;
    return;
  }
  const Duration error = srtt_ > rtt ? srtt_ - rtt : rtt - srtt_;
  rtt_variation_ += (error - rtt_variation_) / 4;
  srtt_ += (rtt - srtt_) / 8;
}

Duration TcpFlow::timeout() const {
  const Duration base = srtt_ + std::max(kLeastVariation, 4 * rtt_variation_);
  return std::min(kMaxTimeout, base * (1 << std::min(backoff_, 10)));
}

}  // namespace slambed
