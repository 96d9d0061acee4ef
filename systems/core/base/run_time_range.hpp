// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.hpp"

namespace slambed {

/// Limit for run times received from outside: a century before or after the start of the run. The
/// difference of any two run times within it fits into 64 bits.
inline constexpr Duration kMaxRunTime = std::chrono::hours(24 * 365 * 100);

constexpr bool is_run_time(std::int64_t ns) {
  return ns <= kMaxRunTime.count() && ns >= -kMaxRunTime.count();
}

}  // namespace slambed
