// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "base/time.hpp"

namespace slambed {

/// Bytes [from, to) of a stream.
struct ByteRange {
  std::uint64_t from = 0, to = 0;
};

/// The acknowledgment of one segment: the next expected byte, the SACK blocks (RFC 2018; three fit
/// next to timestamps, newest first) and the echoed timestamp (RFC 7323).
struct TcpAck {
  std::uint64_t upto = 0;
  RunTime echo{};
  bool duplicate = false;  ///< the segment brought nothing new (RFC 2883)
  std::array<ByteRange, 3> sacked{};
  int blocks = 0;
};

/// The receiving end of one direction. Acknowledges every segment at once, like a live node with
/// TCP_QUICKACK.
class TcpReceiver {
 public:
  TcpAck take(ByteRange segment, RunTime stamp);
  /// Bytes received without a gap.
  std::uint64_t received() const { return received_; }

 private:
  std::uint64_t received_ = 0;
  RunTime echo_{};
  std::map<std::uint64_t, std::uint64_t> early_;  ///< disjoint ranges beyond a gap: from -> to
  std::vector<std::uint64_t> recent_;             ///< a byte of each range, most recent first
};

}  // namespace slambed
