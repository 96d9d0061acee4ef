// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace slambed::link {

inline constexpr double kNsPerS = 1e9;

/// The link's bandwidth: a constant rate, or a Mahimahi trace with one 1,500-byte delivery
/// opportunity per entry, repeated forever.
struct RateOptions {
  double bits_per_s = 0.0;  ///< constant rate; 0 when a trace is given
  std::vector<std::int64_t> opportunities_ns =
      {};                        ///< trace: times from the trace's start, not decreasing
  std::int64_t period_ns = 0;    ///< trace: length before it repeats
  std::int64_t queue_bytes = 0;  ///< queue capacity; a packet that does not fit is dropped
};

/// The bottleneck queue: packets leave one after another at the link's bandwidth. The backlog is
/// counted in bytes.
class Bottleneck {
 public:
  explicit Bottleneck(RateOptions options);

  /// Restarts the trace at this time; opportunities already used are forgotten.
  void set_origin(std::int64_t origin_ns);

  /// Returns when the last byte of this packet leaves, or nothing if the queue is full.
  /// @param now_ns must not decrease from call to call
  std::optional<std::int64_t> admit(std::int64_t now_ns, std::uint32_t bytes);

  /// Returns when the last byte of this packet would leave, without admitting it.
  std::int64_t probe_departure(std::int64_t now_ns, std::uint32_t bytes);

  /// Returns the backlog: bytes admitted that have not left yet.
  std::int64_t waiting_bytes(std::int64_t now_ns);

 private:
  std::int64_t depart(std::int64_t now_ns, std::uint32_t bytes);
  std::int64_t depart_constant(std::int64_t now_ns, std::uint32_t bytes);
  std::int64_t depart_trace(std::int64_t now_ns, std::uint32_t bytes);
  std::int64_t opportunity(std::int64_t index) const;

  struct Departure {
    std::int64_t at_ns;
    std::uint32_t bytes;
  };

  RateOptions options_;
  std::deque<Departure> waiting_;
  std::int64_t waiting_bytes_ = 0;
  std::int64_t free_at_ns_ = 0;  ///< constant rate: when the link is idle again
  std::int64_t origin_ns_ = 0;
  std::int64_t next_index_ =
      0;  ///< trace: next opportunity that is not used yet, over all repetitions
  std::int64_t left_in_current_ = 0;  ///< trace: bytes left of the opportunity before next_index_
};

}  // namespace slambed::link
