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

/// What a receiver answers to one segment: the next byte it expects, what it has beyond (RFC 2018,
/// three blocks beside time stamps, the newest first) and the time stamp that it echoes (RFC 7323).
struct TcpAck {
  std::uint64_t upto = 0;
  RunTime echo{};
  bool duplicate = false;  ///< the segment brought nothing new (RFC 2883)
  std::array<ByteRange, 3> sacked{};
  int blocks = 0;
};

/// The receiving end of one direction. Every segment is acknowledged at once, as the nodes ask for.
class TcpReceiver {
 public:
  TcpAck take(ByteRange segment, RunTime stamp);
  /// Bytes that are here without a hole.
  std::uint64_t received() const { return received_; }

 private:
  std::uint64_t received_ = 0;
  RunTime echo_{};
  std::map<std::uint64_t, std::uint64_t> early_;  ///< pieces beyond a hole: from -> to, apart
  std::vector<std::uint64_t> recent_;             ///< a byte of each piece, last touched first
};

}  // namespace slambed
