// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace slambed::link {

enum class Interpolation { kLinear, kStep };

/// One-way delay as a function of run time, in a table with a fixed step compiled from the profile.
class DelaySchedule {
 public:
  /// @param delays_ns at run times 0, step, 2 step ...; at least one value
  DelaySchedule(std::vector<std::int64_t> delays_ns, std::int64_t step_ns,
                Interpolation interpolation);

  /// Returns the delay at a run time: the first value before 0, the last one after the table's end.
  std::int64_t at(std::int64_t run_time_ns) const;

 private:
  std::vector<std::int64_t> delays_ns_;
  std::int64_t step_ns_;
  Interpolation interpolation_;
};

/// An outage: nothing is delivered in [start, end) of run time.
struct Gap {
  std::int64_t start_ns;
  std::int64_t end_ns;
};

}  // namespace slambed::link
