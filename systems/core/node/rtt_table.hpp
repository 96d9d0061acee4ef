// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
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
    if (when < RunTime::zero()) return values.front();
    const auto before = static_cast<std::size_t>(when / step);
    if (before + 1 >= values.size()) return values.back();
    // In floating point: the product of two long times does not fit into a Duration.
    const double share =
        static_cast<double>((when % step).count()) / static_cast<double>(step.count());
    const double change = static_cast<double>((values[before + 1] - values[before]).count());
    return values[before] + Duration(std::llround(change * share));
  }
};

}  // namespace slambed
