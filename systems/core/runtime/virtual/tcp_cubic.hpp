// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/time.hpp"

namespace slambed {

/// CUBIC (RFC 9438) with HyStart, as in Linux: the congestion window, its growth and its reduction
/// after a loss. `TcpFlow` sets `window` itself in recovery, after a retransmission timeout, and
/// when the window was idle or not fully used. Windows are in segments.
class TcpCubic {
 public:
  static constexpr double kInitialWindow = 10;  ///< RFC 6928

  double window = kInitialWindow;  ///< cwnd
  double slow_start_limit = 1e9;   ///< ssthresh

  bool slow_start() const { return window < slow_start_limit; }
  /// Returns the reduced window after a loss and restarts the growth curve.
  double reduced();
  /// Call when segments were acknowledged while the window limited the sender.
  void grow(double segments, RunTime now, Duration rtt);
  /// Takes every RTT sample. Ends slow start before the queue overflows (HyStart).
  void sample_rtt(Duration rtt, RunTime now, std::uint64_t acknowledged, std::uint64_t next);
  /// Call after idle time: the growth curve is a function of the time in which the sender had data.
  void idle(Duration time);
  void forget_epoch() { in_epoch_ = false; }

 private:
  double wanted_acks(RunTime now, Duration rtt);

  double last_most_ = 0;  ///< window before the last reduction
  double origin_ = 0;     ///< plateau of the curve
  double estimate_ = 0;   ///< the window that Reno would have
  Duration to_origin_{};  ///< from the epoch's start to the plateau
  RunTime epoch_{};
  bool in_epoch_ = false;
  Duration least_rtt_ = Duration::max();
  // HyStart: the current round trip.
  std::uint64_t round_end_ = 0;
  RunTime round_begin_{}, last_ack_{};
  Duration round_rtt_ = Duration::max();
  int samples_ = 0;
};

}  // namespace slambed
