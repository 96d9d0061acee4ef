// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/tcp_scoreboard.hpp"

#include <algorithm>
#include <utility>

namespace slambed {

void TcpScoreboard::arrived(const TcpSegment& segment, RunTime now, TcpAckResult& result) {
  ++result.delivered;
  const Duration rtt = now - segment.sent;
  if (!segment.retransmitted) {
    result.original = true;
    if (!result.rtt) result.rtt = rtt;
    least_rtt_ = std::min(least_rtt_, rtt);
  } else if (rtt < least_rtt_) {
    return;  // the original has arrived, not the retransmission
  }
  if (std::pair(segment.sent, segment.bytes.to) > std::pair(newest_sent_, newest_end_)) {
    newest_sent_ = segment.sent;
    newest_end_ = segment.bytes.to;
    newest_rtt_ = rtt;
  }
}

TcpAckResult TcpScoreboard::take(const TcpAck& ack, RunTime now) {
  TcpAckResult result;
  while (!segments_.empty() && segments_.front().bytes.to <= ack.upto) {
    TcpSegment& first = segments_.front();
    if (first.sacked) {
      --sacked_;
    } else {
      arrived(first, now, result);
    }
    if (first.lost) --lost_;
    ++result.acknowledged;
    segments_.pop_front();
  }
  for (int i = 0; i < ack.blocks; ++i) {
    const ByteRange block = ack.sacked[static_cast<std::size_t>(i)];
    auto segment = std::lower_bound(
        segments_.begin(), segments_.end(), block.from,
        [](const TcpSegment& s, std::uint64_t from) { return s.bytes.from < from; });
    for (; segment != segments_.end() && segment->bytes.to <= block.to; ++segment) {
      if (segment->sacked) continue;
      arrived(*segment, now, result);
      if (std::exchange(segment->lost, false)) --lost_;
      segment->sacked = true;
      ++sacked_;
    }
  }
  return result;
}

bool TcpScoreboard::before_newest(const TcpSegment& segment) const {
  return std::pair(segment.sent, segment.bytes.to) < std::pair(newest_sent_, newest_end_);
}

void TcpScoreboard::mark_lost(TcpSegment& segment) {
  segment.lost = true;
  segment.again = false;
  ++lost_;
}

std::optional<RunTime> TcpScoreboard::find_losses(RunTime now, Duration reordering) {
  std::optional<RunTime> look_again;
  for (TcpSegment& segment : segments_) {
    if (segment.sacked || segment.lost || !before_newest(segment)) continue;
    const RunTime patience = segment.sent + newest_rtt_ + reordering;
    if (patience <= now) {
      mark_lost(segment);
    } else {
      look_again = std::max(look_again.value_or(patience), patience);
    }
  }
  return look_again;
}

void TcpScoreboard::on_retransmission_timeout(RunTime now) {
  for (TcpSegment& segment : segments_) {
    const bool recent = &segment != &segments_.front() && segment.sent + newest_rtt_ > now;
    if (!segment.sacked && !segment.lost && !recent) mark_lost(segment);
  }
}

void TcpScoreboard::undo_losses() {
  for (TcpSegment& segment : segments_) segment.lost = false;
  lost_ = 0;
}

TcpSegment* TcpScoreboard::next_lost() {
  if (lost_ == 0) return nullptr;
  for (TcpSegment& segment : segments_) {
    if (segment.lost) return &segment;
  }
  return nullptr;
}

void TcpScoreboard::retransmit(TcpSegment& segment, RunTime now) {
  if (std::exchange(segment.lost, false)) --lost_;
  segment.sent = now;
  segment.retransmitted = true;
  segment.again = true;
}

}  // namespace slambed
