// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "base/time.hpp"
#include "runtime/virtual/tcp_receiver.hpp"

namespace slambed {

/// A segment that was sent and is not acknowledged yet.
struct TcpSegment {
  ByteRange bytes;
  RunTime sent{};              ///< last transmission
  bool retransmitted = false;  ///< at least once
  bool sacked = false;
  bool lost = false;   ///< marked lost and not retransmitted since
  bool again = false;  ///< retransmitted after a loss, in flight
};

/// What one acknowledgment changed.
struct TcpAckResult {
  int acknowledged = 0;         ///< segments below the cumulative ACK
  int delivered = 0;            ///< segments newly known to have arrived
  bool original = false;        ///< one of them had never been retransmitted
  std::optional<Duration> rtt;  ///< of a segment that was sent once
};

/// The sender's state of the unacknowledged segments. Marks as lost those that were sent before one
/// that has arrived (RACK, RFC 8985).
class TcpScoreboard {
 public:
  void sent(const TcpSegment& segment) { segments_.push_back(segment); }
  TcpAckResult take(const TcpAck& ack, RunTime now);

  /// Marks lost segments. Returns when to check again the segments that may only be late, or
  /// nothing.
  std::optional<RunTime> find_losses(RunTime now, Duration reordering);
  /// Marks as lost the first segment and all that were not sent within the last round trip.
  void on_retransmission_timeout(RunTime now);
  /// Call when a timeout was spurious: unmarks all segments.
  void undo_losses();

  /// Returns the first lost segment, or nullptr.
  TcpSegment* next_lost();
  void retransmit(TcpSegment& segment, RunTime now);
  TcpSegment& first() { return segments_.front(); }
  TcpSegment& last() { return segments_.back(); }

  bool empty() const { return segments_.empty(); }
  int outstanding() const { return static_cast<int>(segments_.size()); }
  int sacked() const { return sacked_; }
  int lost() const { return lost_; }
  int in_flight() const { return outstanding() - sacked_ - lost_; }

 private:
  void arrived(const TcpSegment& segment, RunTime now, TcpAckResult& result);
  bool before_newest(const TcpSegment& segment) const;
  void mark_lost(TcpSegment& segment);

  std::deque<TcpSegment> segments_;
  int sacked_ = 0, lost_ = 0;
  // RACK: of all segments that arrived, the one sent last.
  RunTime newest_sent_{};
  std::uint64_t newest_end_ = 0;
  Duration newest_rtt_{}, least_rtt_ = Duration::max();
};

}  // namespace slambed
