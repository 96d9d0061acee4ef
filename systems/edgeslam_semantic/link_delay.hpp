// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "base/time.hpp"

namespace slambed::edgeslam_semantic {

/// The paper's N = L + M / B (section V): L from probes, B and M from acknowledged uploads. All
/// times are the mobile's own. Thread-safe.
class LinkDelay {
 public:
  /// one_way: L is half the round trip, as M / B is one way; else all of it.
  explicit LinkDelay(bool one_way) : one_way_(one_way) {}

  /// A probe came back.
  void probed(Duration round_trip);
  /// An upload is about to go to the channel, which gives it a number ...
  void going(std::size_t bytes, RunTime when);
  /// ... this one. Its answer may have come meanwhile.
  void numbered(std::uint64_t sequence);
  /// The edge has told that it came; unknown and repeated numbers are ignored.
  void acknowledged(std::uint64_t sequence, RunTime when);

  std::optional<Duration> round_trip() const;
  std::optional<double> bytes_per_s() const;
  /// M: mean of the last five uploads, 0 before the first.
  double mean_bytes() const;
  /// Nothing until a probe and an upload have come back.
  std::optional<Duration> delay() const;

 private:
  struct Upload {
    std::size_t bytes = 0;
    RunTime sent{};
    bool behind = false;  ///< sent while another was under way
  };

  void acknowledged_locked(std::uint64_t sequence, RunTime when);
  double mean_bytes_locked() const;

  bool one_way_;
  mutable std::mutex mutex_;  ///< guards what follows
  std::optional<Duration> round_trip_;
  std::optional<double> seconds_per_byte_;
  std::map<std::uint64_t, Upload> under_way_;
  std::optional<Upload> going_;                      ///< has no number yet
  std::map<std::uint64_t, RunTime> answered_early_;  ///< while it has none
  std::deque<std::size_t> sizes_;
  RunTime last_acknowledged_{};
};

}  // namespace slambed::edgeslam_semantic
