// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.hpp"

namespace slambed {

/// Run times count from the start of a run: a century either way is more than any has. What comes
/// from outside must lie within, so that the difference of any two fits.
inline constexpr Duration kMaxRunTime = std::chrono::hours(24 * 365 * 100);

constexpr bool is_run_time(std::int64_t ns) {
  return ns <= kMaxRunTime.count() && ns >= -kMaxRunTime.count();
}

}  // namespace slambed
