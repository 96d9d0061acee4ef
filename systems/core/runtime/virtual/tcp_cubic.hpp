// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/time.hpp"

namespace slambed {

/// CUBIC (RFC 9438) with HyStart, as Linux has them: the congestion window, its growth and its cut
/// after a loss. `TcpFlow` sets `window` itself in recovery, after a time-out (RTO), and after idle
/// time or unused room. Windows are in segments.
class TcpCubic {
 public:
  static constexpr double kInitialWindow = 10;  ///< RFC 6928

  double window = kInitialWindow;  ///< cwnd
  double slow_start_limit = 1e9;   ///< ssthresh

  bool slow_start() const { return window < slow_start_limit; }
  /// After a loss: the window to go down to; the growth curve starts anew.
  double reduced();
  /// Segments were acknowledged while the window limited the sender.
  void grow(double segments, RunTime now, Duration rtt);
  /// Every sample of the RTT; ends slow start before the queue overflows.
  void sample_rtt(Duration rtt, RunTime now, std::uint64_t acknowledged, std::uint64_t next);
  /// The sender had nothing to send; the growth curve is a function of busy time.
  void idle(Duration time);
  void forget_epoch() { in_epoch_ = false; }

 private:
  double wanted_acks(RunTime now, Duration rtt);

  double last_most_ = 0;  ///< window before the last reduction
  double origin_ = 0;     ///< plateau of the curve
  double estimate_ = 0;   ///< what Reno would have by now
  Duration to_origin_{};  ///< from the epoch's begin to the plateau
  RunTime epoch_{};
  bool in_epoch_ = false;
  Duration least_rtt_ = Duration::max();
  // HyStart: one round trip.
  std::uint64_t round_end_ = 0;
  RunTime round_begin_{}, last_ack_{};
  Duration round_rtt_ = Duration::max();
  int samples_ = 0;
};

}  // namespace slambed
