// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "base/time.hpp"

namespace slambed::edgeslam_semantic {

/// Estimates the paper's N = L + M / B (section V): L from probes, B and M from acknowledged
/// uploads. All times are on the mobile's clock. Thread-safe.
class LinkDelay {
 public:
  /// one_way: L is half the RTT, because M / B is one way too; otherwise L is the whole RTT.
  explicit LinkDelay(bool one_way) : one_way_(one_way) {}

  /// Adds the RTT of a probe.
  void probed(Duration round_trip);
  /// Notes an upload right before it is passed to the channel, when it has no sequence number yet.
  void going(std::size_t bytes, RunTime when);
  /// Gives that upload its sequence number. Its acknowledgment may already have arrived.
  void numbered(std::uint64_t sequence);
  /// Notes the edge's acknowledgment; ignores unknown and repeated sequence numbers.
  void acknowledged(std::uint64_t sequence, RunTime when);

  std::optional<Duration> round_trip() const;
  std::optional<double> bytes_per_s() const;
  /// M: mean size of the last five uploads, 0 before the first.
  double mean_bytes() const;
  /// Returns N, or nothing until both a probe and an upload were acknowledged.
  std::optional<Duration> delay() const;

 private:
  struct Upload {
    std::size_t bytes = 0;
    RunTime sent{};
    bool behind = false;  ///< sent while another was unacknowledged
  };

  void acknowledged_locked(std::uint64_t sequence, RunTime when);
  double mean_bytes_locked() const;

  bool one_way_;
  mutable std::mutex mutex_;  ///< guards what follows
  std::optional<Duration> round_trip_;
  std::optional<double> seconds_per_byte_;
  std::map<std::uint64_t, Upload> under_way_;
  std::optional<Upload> going_;                      ///< has no sequence number yet
  std::map<std::uint64_t, RunTime> answered_early_;  ///< acknowledgments that came meanwhile
  std::deque<std::size_t> sizes_;
  RunTime last_acknowledged_{};
};

}  // namespace slambed::edgeslam_semantic
