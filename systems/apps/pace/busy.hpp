// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace slambed::pace {

struct BusyOptions {
  int threads = 1;
  double seconds = 5.0;
  double settle_s = 0.0;  ///< busy time before counting starts, while the engine applies CPU limits
};

/// Result of one thread that is always busy.
struct BusyThread {
  double units_per_s = 0.0;        ///< of wall time
  double units_per_cpu_s = 0.0;    ///< of the thread's CPU time
  double cpu_share = 0.0;          ///< CPU time per wall time
  double longest_freeze_ms = 0.0;  ///< longest time without progress
  int freezes_over_10_ms = 0;
  std::uint64_t checksum = 0;  ///< of the first 100 units, so independent of the speed
};

/// Keeps all threads (named busy-0, ...) busy at once and returns their results.
std::vector<BusyThread> measure_busy(const BusyOptions& options);

std::string busy_json(const BusyOptions& options, const std::vector<BusyThread>& threads);

}  // namespace slambed::pace
