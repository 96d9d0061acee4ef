// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>

#include "base/time.hpp"
#include "runtime/virtual/path_model.hpp"
#include "runtime/virtual/simulator.hpp"

namespace slambed {

/// One direction of a TCP connection, segment by segment: ACK clocking, slow start, a window that an
/// idle time halves once per time-out down to the initial one (RFC 2861, as Linux does it),
/// congestion avoidance, fast retransmit with NewReno recovery (RFC 6582), time-outs and the smoothed
/// RTT of RFC 6298, sampled with time stamps (RFC 7323) and per ACK. Every segment is acknowledged at
/// once, as the nodes ask for with TCP_QUICKACK.
class TcpFlow {
 public:
  static constexpr std::uint32_t kSegmentBytes = 1448;  ///< 1500-byte packets with time stamps
  static constexpr std::uint32_t kHeaderBytes = 52;     ///< IPv4 and TCP with time stamps

  /// on_delivered(n): the receiver has the first n bytes of the stream, in order.
  TcpFlow(Simulator& simulator, PathModel& data_path, PathModel& ack_path,
          std::function<void(std::uint64_t)> on_delivered, std::function<void()> on_acknowledged);

  /// Appends bytes to the stream.
  void write(std::uint64_t bytes);
  /// The first sample comes from the handshake.
  void start(Duration handshake_rtt) { sample(handshake_rtt); }

  Duration smoothed_rtt() const { return srtt_; }
  std::uint64_t unsent() const { return written_ - next_; }
  std::uint64_t unacknowledged() const { return next_ - acknowledged_; }
  std::uint64_t retransmissions() const { return retransmissions_; }

 private:
  void close_window_after(Duration idle);
  void pump();
  void send_segment(std::uint64_t from);
  void arrive(std::uint64_t from, std::uint64_t to, RunTime stamp);
  void acknowledge(std::uint64_t upto, RunTime stamp);
  void arm_timer();
  void time_out();
  void sample(Duration rtt);
  Duration timeout() const;

  Simulator& simulator_;
  PathModel& data_path_;
  PathModel& ack_path_;
  std::function<void(std::uint64_t)> on_delivered_;
  std::function<void()> on_acknowledged_;

  // Sender.
  std::uint64_t written_ = 0, next_ = 0, acknowledged_ = 0;
  double window_ = 10.0 * kSegmentBytes;  ///< congestion window; initial value of RFC 6928
  double slow_start_limit_ = 1e12;
  int duplicates_ = 0;
  std::optional<std::uint64_t> recovery_end_;
  RunTime last_sent_{};
  Duration srtt_{}, rtt_variation_{};
  int backoff_ = 0;
  std::uint64_t timer_ = 0, armed_ = 0;  ///< number of the running timer (0: none) and of the last
  std::uint64_t retransmissions_ = 0;
  // Receiver.
  std::uint64_t received_ = 0;
  std::map<std::uint64_t, std::uint64_t> early_;  ///< out-of-order pieces: from -> to
};

}  // namespace slambed
