// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/tcp_receiver.hpp"

#include <algorithm>
#include <iterator>

namespace slambed {

TcpAck TcpReceiver::take(ByteRange segment, RunTime stamp) {
  // Only a segment at the left window edge updates the echoed timestamp (RFC 7323). The sender can
  // then tell whether an original or its retransmission filled a gap.
  if (segment.from <= received_) echo_ = stamp;
  TcpAck ack{.duplicate = segment.to <= received_};
  if (segment.to > received_) {
    auto piece = early_.upper_bound(segment.from);
    if (piece != early_.begin() && std::prev(piece)->second >= segment.from) --piece;
    ack.duplicate =
        piece != early_.end() && piece->first <= segment.from && piece->second >= segment.to;
    ByteRange whole = segment;
    while (piece != early_.end() && piece->first <= whole.to) {
      whole = {std::min(whole.from, piece->first), std::max(whole.to, piece->second)};
      piece = early_.erase(piece);
    }
    if (whole.from <= received_) {
      received_ = whole.to;
    } else {
      early_[whole.from] = whole.to;
      recent_.insert(recent_.begin(), segment.from);
    }
  }
  std::vector<std::uint64_t> kept;
  for (const std::uint64_t byte : recent_) {
    auto piece = early_.upper_bound(byte);
    if (piece == early_.begin() || (--piece)->second <= byte) continue;
    const auto blocks = std::span(ack.sacked).first(static_cast<std::size_t>(ack.blocks));
    if (std::any_of(blocks.begin(), blocks.end(),
                    [&](const ByteRange& b) { return b.from == piece->first; }))
      continue;
    if (ack.blocks == static_cast<int>(ack.sacked.size())) break;
    ack.sacked[static_cast<std::size_t>(ack.blocks++)] = {piece->first, piece->second};
    kept.push_back(byte);
  }
  recent_ = std::move(kept);
  ack.upto = received_;
  ack.echo = echo_;
  return ack;
}

}  // namespace slambed
