// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/time.hpp"

namespace slambed {

/// The RTT that the run's link profile asks for, over run time: what a strategy would see if it
/// measured without error and delay.
struct RttTable {
  Duration step{};
  std::vector<Duration> values;  ///< at 0, step, 2 steps ...; at least one

  /// Linear between two values, the first before run time 0, the last one for ever.
  Duration at(RunTime when) const {
    const auto last = static_cast<std::int64_t>(values.size()) - 1;
    const RunTime t = std::clamp(when, RunTime::zero(), step * last);
    const std::int64_t before = std::min(t / step, std::max<std::int64_t>(last - 1, 0));
    const Duration low = values[static_cast<std::size_t>(before)];
    const Duration high = values[static_cast<std::size_t>(std::min(before + 1, last))];
    return low + Duration((high - low).count() * (t - step * before).count() / step.count());
  }
};

}  // namespace slambed
