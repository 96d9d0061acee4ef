// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/tcp_flow.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace slambed {
namespace {

using namespace std::chrono_literals;

constexpr int kDuplicatesForLoss = 3;
// Linux bounds the variation term of the RTO from below, RFC 6298 the whole RTO (1 s).
constexpr Duration kLeastVariation = 200ms;
constexpr Duration kMaxTimeout = 120s;
constexpr Duration kProbeMargin = 2ms;  ///< two jiffies in Linux

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
  if (board_.empty()) {
    const Duration idle = simulator_.now() - last_sent_;
    close_window_after(idle);
    cubic_.idle(idle);
  }
  written_ += bytes;
  pump();
}

void TcpFlow::close_window_after(Duration idle) {
  if (idle <= retransmission_timeout()) return;
  cubic_.slow_start_limit = std::max(cubic_.slow_start_limit, 0.75 * cubic_.window);
  for (idle -= retransmission_timeout();
       idle > Duration(0) && cubic_.window > TcpCubic::kInitialWindow;
       idle -= retransmission_timeout()) {
    cubic_.window = std::max(cubic_.window / 2, TcpCubic::kInitialWindow);
  }
  used_since_ = simulator_.now();
  used_ = 0;
}

void TcpFlow::transmit(ByteRange bytes) {
  const RunTime stamp = simulator_.now();
  last_sent_ = stamp;
  ++sent_in_recovery_;
  data_path_.transmit(static_cast<std::uint32_t>(bytes.to - bytes.from) + kHeaderBytes,
                      [this, bytes, stamp] { arrive(bytes, stamp); });
}

void TcpFlow::send_new() {
  const ByteRange bytes{next_, std::min(written_, next_ + kSegmentBytes)};
  next_ = bytes.to;
  board_.sent({.bytes = bytes, .sent = simulator_.now()});
  transmit(bytes);
}

void TcpFlow::retransmit(TcpSegment& segment) {
  board_.retransmit(segment, simulator_.now());
  transmit(segment.bytes);
}

void TcpFlow::pump() {
  const std::uint64_t before = next_;
  bool limited = false;
  // During F-RTO, new data are sent first: their ACKs show whether the timeout was spurious.
  while (TcpSegment* lost = testing_ ? nullptr : board_.next_lost()) {
    if (board_.in_flight() + 1 > cubic_.window) {
      limited = true;
      break;
    }
    retransmit(*lost);
  }
  while (!limited && next_ < written_) {
    if (board_.in_flight() + 1 > cubic_.window) {
      limited = true;
      break;
    }
    send_new();
  }
  validate_window(limited);
  if (next_ != before || armed_ == Timer::kNone) rearm();
}

/// Shrinks a congestion window that is not used up: the path has not confirmed it (RFC 2861, as in
/// Linux).
void TcpFlow::validate_window(bool limited) {
  const int out = board_.outstanding();
  if (acknowledged_ >= usage_end_ || limited || (!limited_ && out > most_out_)) {
    limited_ = limited;
    most_out_ = out;
    usage_end_ = next_;
  }
  if (window_limits()) {
    used_ = 0;
    used_since_ = simulator_.now();
    return;
  }
  used_ = std::max(used_, out);
  if (state_ != State::kOpen || simulator_.now() - used_since_ < retransmission_timeout()) return;
  const double used = std::max<double>(used_, TcpCubic::kInitialWindow);
  if (used < cubic_.window) {
    cubic_.slow_start_limit = std::max(cubic_.slow_start_limit, 0.75 * cubic_.window);
    cubic_.window = (cubic_.window + used) / 2;
  }
  used_ = 0;
  used_since_ = simulator_.now();
}

bool TcpFlow::window_limits() const {
  return limited_ || (cubic_.slow_start() && cubic_.window < 2 * most_out_);
}

void TcpFlow::arrive(ByteRange bytes, RunTime stamp) {
  const std::uint64_t before = receiver_.received();
  const TcpAck ack = receiver_.take(bytes, stamp);
  ack_path_.transmit(kHeaderBytes, [this, ack] { acknowledge(ack); });
  if (receiver_.received() > before) on_delivered_(receiver_.received());
}

void TcpFlow::acknowledge(const TcpAck& ack) {
  if (ack.upto < acknowledged_) return;
  const bool advanced = ack.upto > acknowledged_;
  const RunTime now = simulator_.now();
  const TcpAckResult result = board_.take(ack, now);
  acknowledged_ = ack.upto;
  if (advanced || result.rtt) {
    const Duration rtt = result.rtt.value_or(now - ack.echo);
    sample_rtt(rtt);
    if (result.rtt) cubic_.sample_rtt(rtt, now, acknowledged_, next_);
  }
  if (advanced) backoff_ = 0;
  finish_tail_probe(ack);
  if (state_ == State::kLoss) after_loss_timeout(ack, result);
  if (state_ == State::kRecovery && acknowledged_ >= recovery_end_) {
    cubic_.window = cubic_.slow_start_limit;
    state_ = State::kOpen;
  }
  const int lost_before = board_.lost();
  find_losses(result);
  if (state_ == State::kRecovery) {
    reduce_window(result, board_.lost() > lost_before);
  } else if (advanced && window_limits()) {
    cubic_.grow(result.acknowledged, now, srtt_);
  }
  if (advanced) armed_ = Timer::kNone;
  pump();
  if (advanced) on_acknowledged_();
}

void TcpFlow::after_loss_timeout(const TcpAck& ack, const TcpAckResult& result) {
  const bool advanced = result.acknowledged > 0;
  if ((advanced && ack.echo < resent_) || (testing_ && result.original && next_ == recovery_end_)) {
    undo();
    return;
  }
  if (acknowledged_ >= recovery_end_) {
    state_ = State::kOpen;
    testing_ = false;
    return;
  }
  if (!testing_) return;
  if (next_ > recovery_end_) {
    // New data were acknowledged and old segments are still missing, so these are lost.
    if (!advanced) testing_ = false;
  } else if (advanced) {
    recovery_end_ = next_;
    testing_ = next_ < written_;
  } else {
    testing_ = false;
  }
}

void TcpFlow::undo() {
  board_.undo_losses();
  cubic_.window = std::max(cubic_.window, window_before_);
  cubic_.slow_start_limit = std::max(cubic_.slow_start_limit, limit_before_);
  state_ = State::kOpen;
  testing_ = false;
}

void TcpFlow::find_losses(const TcpAckResult& result) {
  if (board_.sacked() == 0 && state_ == State::kOpen) return;
  if (result.delivered == 0 && armed_ != Timer::kNone) return;
  // The link never reorders packets, so three SACKed segments beyond a gap are enough.
  const bool sure = state_ != State::kOpen || board_.sacked() >= kDuplicatesForLoss;
  const auto look_again =
      board_.find_losses(simulator_.now(), sure ? Duration(0) : std::min(least_rtt_ / 4, srtt_));
  if (board_.lost() > 0 && state_ == State::kOpen) enter_recovery();
  if (look_again) arm(Timer::kReordering, *look_again);
}

void TcpFlow::enter_recovery() {
  state_ = State::kRecovery;
  recovery_end_ = next_;
  probe_end_.reset();
  window_before_ = cubic_.window;
  limit_before_ = cubic_.slow_start_limit;
  cubic_.slow_start_limit = cubic_.reduced();
  recovered_ = sent_in_recovery_ = 0;
}

void TcpFlow::reduce_window(const TcpAckResult& result, bool newly_lost) {
  if (result.delivered == 0) return;
  recovered_ += result.delivered;
  const double limit = cubic_.slow_start_limit, flying = board_.in_flight();
  double may_send;
  if (flying > limit) {
    may_send = std::max(0.0, std::ceil(limit * recovered_ / window_before_) - sent_in_recovery_);
  } else {
    may_send = std::max(recovered_ - sent_in_recovery_, result.delivered);
    if (result.acknowledged > 0 && !newly_lost) ++may_send;
    may_send = std::min(limit - flying, may_send);
  }
  if (sent_in_recovery_ == 0) may_send = std::max(may_send, 1.0);
  cubic_.window = flying + may_send;
}

void TcpFlow::finish_tail_probe(const TcpAck& ack) {
  if (!probe_end_ || ack.upto < *probe_end_) return;
  if (!probe_was_old_ || ack.duplicate) {
    probe_end_.reset();
  } else if (ack.upto > *probe_end_) {
    // The probe repaired a loss, which must reduce the window like any other.
    probe_end_.reset();
    if (state_ != State::kOpen) return;
    cubic_.slow_start_limit = cubic_.reduced();
    cubic_.window = std::min(cubic_.window, cubic_.slow_start_limit);
  }
}

void TcpFlow::arm(Timer kind, RunTime when) {
  armed_ = kind;
  simulator_.at(when, [this, kind, mine = ++timer_] {
    if (timer_ == mine && armed_ == kind) expire(kind);
  });
}

void TcpFlow::rearm() {
  if (board_.empty()) {
    armed_ = Timer::kNone;
    return;
  }
  if (armed_ == Timer::kReordering) return;
  const RunTime now = simulator_.now();
  if (state_ == State::kOpen && board_.sacked() == 0 && !probe_end_) {
    const Duration more = board_.outstanding() == 1 ? kLeastVariation : kProbeMargin;
    arm(Timer::kTailProbe, now + std::min(2 * srtt_ + more, retransmission_timeout()));
  } else {
    arm(Timer::kTimeout, now + retransmission_timeout());
  }
}

void TcpFlow::expire(Timer kind) {
  armed_ = Timer::kNone;
  if (board_.empty()) return;
  switch (kind) {
    case Timer::kTailProbe:
      probe_tail();
      break;
    case Timer::kReordering:
      board_.find_losses(simulator_.now(), Duration(0));
      if (board_.lost() > 0 && state_ == State::kOpen) {
        enter_recovery();
        cubic_.window = board_.in_flight() + 1;
      }
      pump();
      break;
    default:
      on_retransmission_timeout();
  }
}

void TcpFlow::probe_tail() {
  probe_was_old_ = next_ == written_;
  if (probe_was_old_) {
    retransmit(board_.last());
  } else {
    send_new();
  }
  probe_end_ = next_;
  arm(Timer::kTimeout, simulator_.now() + retransmission_timeout());
}

void TcpFlow::on_retransmission_timeout() {
  const bool first = state_ != State::kLoss;
  const bool fresh = state_ == State::kOpen || acknowledged_ >= recovery_end_;
  if (fresh) {
    window_before_ = cubic_.window;
    limit_before_ = cubic_.slow_start_limit;
    cubic_.slow_start_limit = cubic_.reduced();
  }
  testing_ = fresh || !first;
  state_ = State::kLoss;
  cubic_.forget_epoch();
  board_.on_retransmission_timeout(simulator_.now());
  cubic_.window = board_.in_flight() + 1;
  recovery_end_ = next_;
  probe_end_.reset();
  if (first) resent_ = simulator_.now();
  ++backoff_;
  retransmit(board_.first());
  arm(Timer::kTimeout, simulator_.now() + retransmission_timeout());
}

void TcpFlow::sample_rtt(Duration rtt) {
  least_rtt_ = std::min(least_rtt_, rtt);
  if (srtt_ == Duration::zero()) {
    srtt_ = rtt;
    rtt_variation_ = rtt / 2;
    return;
  }
  const Duration error = srtt_ > rtt ? srtt_ - rtt : rtt - srtt_;
  rtt_variation_ += (error - rtt_variation_) / 4;
  srtt_ += (rtt - srtt_) / 8;
}

Duration TcpFlow::retransmission_timeout() const {
  const Duration base = srtt_ + std::max(kLeastVariation, 4 * rtt_variation_);
  return std::min(kMaxTimeout, base * (1 << std::min(backoff_, 10)));
}

}  // namespace slambed
