// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "base/time.hpp"
#include "runtime/virtual/path_model.hpp"
#include "runtime/virtual/simulator.hpp"
#include "runtime/virtual/tcp_cubic.hpp"
#include "runtime/virtual/tcp_scoreboard.hpp"

namespace slambed {

/// One direction of a TCP connection, segment by segment, as in Linux. It models ACK clocking and
/// CUBIC with HyStart, and validates the congestion window (cwnd) after idle time and partial use
/// (RFC 2861). Losses are found with SACK, RACK and tail-loss probes (RFC 8985); recovery is
/// proportional rate reduction (RFC 6937). A timeout leads to slow start and is undone if F-RTO
/// (RFC 5682) finds it spurious. The smoothed RTT is that of RFC 6298. Every segment is
/// acknowledged at once, because the nodes set TCP_QUICKACK.
class TcpFlow {
 public:
  static constexpr std::uint32_t kSegmentBytes = 1448;  ///< 1500-byte packets with timestamps
  static constexpr std::uint32_t kHeaderBytes = 52;     ///< IPv4 and TCP with timestamps

  /// on_delivered(n): the receiver has the first n bytes of the stream, in order.
  TcpFlow(Simulator& simulator, PathModel& data_path, PathModel& ack_path,
          std::function<void(std::uint64_t)> on_delivered, std::function<void()> on_acknowledged);

  void write(std::uint64_t bytes);
  /// Takes the first RTT sample, that of the handshake.
  void start(Duration handshake_rtt) { sample_rtt(handshake_rtt); }

  Duration smoothed_rtt() const { return srtt_; }
  std::uint64_t unsent() const { return written_ - next_; }
  std::uint64_t unacknowledged() const { return next_ - acknowledged_; }

 private:
  enum class State { kOpen, kRecovery, kLoss };
  enum class Timer { kNone, kTimeout, kTailProbe, kReordering };

  // Sending.
  void pump();
  void transmit(ByteRange bytes);
  void send_new();
  void retransmit(TcpSegment& segment);
  void validate_window(bool limited);
  bool window_limits() const;
  void close_window_after(Duration idle);
  // Receiving acknowledgments.
  void arrive(ByteRange bytes, RunTime stamp);
  void acknowledge(const TcpAck& ack);
  void after_loss_timeout(const TcpAck& ack, const TcpAckResult& result);
  void find_losses(const TcpAckResult& result);
  void enter_recovery();
  void reduce_window(const TcpAckResult& result, bool newly_lost);
  void finish_tail_probe(const TcpAck& ack);
  void undo();
  // Timers and RTT.
  void arm(Timer kind, RunTime when);
  void rearm();
  void expire(Timer kind);
  void on_retransmission_timeout();
  void probe_tail();
  void sample_rtt(Duration rtt);
  /// RTO: smoothed RTT + max(200 ms, 4 variations), doubled per timeout, at most 120 s.
  Duration retransmission_timeout() const;

  Simulator& simulator_;
  PathModel& data_path_;
  PathModel& ack_path_;
  std::function<void(std::uint64_t)> on_delivered_;
  std::function<void()> on_acknowledged_;

  std::uint64_t written_ = 0, next_ = 0, acknowledged_ = 0;
  TcpScoreboard board_;
  TcpCubic cubic_;
  TcpReceiver receiver_;  ///< the peer's

  State state_ = State::kOpen;
  std::uint64_t recovery_end_ = 0;               ///< end of the data sent when the loss was found
  double window_before_ = 0, limit_before_ = 0;  ///< for undo(), and for the recovery rate
  int recovered_ = 0, sent_in_recovery_ = 0;
  RunTime resent_{};                        ///< first retransmission after this timeout
  bool testing_ = false;                    ///< F-RTO checks whether the timeout was spurious
  std::optional<std::uint64_t> probe_end_;  ///< set while a tail-loss probe is in flight
  bool probe_was_old_ = false;

  bool limited_ = false;  ///< the window stopped the sender
  int most_out_ = 0;      ///< most segments in flight in this round trip
  std::uint64_t usage_end_ = 0;
  int used_ = 0;  ///< most segments in flight while the window was not full
  RunTime used_since_{};

  RunTime last_sent_{};
  Duration srtt_{}, rtt_variation_{}, least_rtt_ = Duration::max();
  int backoff_ = 0;
  std::uint64_t timer_ = 0;  ///< number of the last timer armed; older ones do nothing
  Timer armed_ = Timer::kNone;
};

}  // namespace slambed
