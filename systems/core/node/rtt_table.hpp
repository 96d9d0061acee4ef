// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "base/time.hpp"

namespace slambed {

/// The link profile's RTT over run time, as a measurement without error and delay would give it.
struct RttTable {
  Duration step{};
  std::vector<Duration> values;  ///< at 0, step, 2 steps ...; at least one

  /// Interpolates linearly; the first value holds before run time 0, the last one after the end.
  Duration at(RunTime when) const {
    if (when < RunTime::zero()) return values.front();
    const auto before = static_cast<std::size_t>(when / step);
    if (before + 1 >= values.size()) return values.back();
    // In floating point, because the product of two long durations overflows.
    const double share =
        static_cast<double>((when % step).count()) / static_cast<double>(step.count());
    const double change = static_cast<double>((values[before + 1] - values[before]).count());
    return values[before] + Duration(std::llround(change * share));
  }
};

}  // namespace slambed
