// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ctime>

#include <cstdint>

namespace slambed::relay {

inline constexpr std::int64_t kNsPerSecond = 1'000'000'000;

/// Returns CLOCK_MONOTONIC, the clock of run time.
inline std::int64_t monotonic_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kNsPerSecond + now.tv_nsec;
}

}  // namespace slambed::relay
