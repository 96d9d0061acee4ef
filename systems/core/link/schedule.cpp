// SPDX-License-Identifier: Apache-2.0
#include "link/schedule.hpp"

#include <utility>

#include "base/error.hpp"

namespace slambed::link {

DelaySchedule::DelaySchedule(std::vector<std::int64_t> delays_ns, std::int64_t step_ns,
                             Interpolation interpolation)
    : delays_ns_(std::move(delays_ns)), step_ns_(step_ns), interpolation_(interpolation) {
  if (delays_ns_.empty())
    throw bad_input("delay table is empty, delay_us, give at least one value");
  if (step_ns_ <= 0) throw bad_input("step is not positive, step_ms, give milliseconds above 0");
}

std::int64_t DelaySchedule::at(std::int64_t run_time_ns) const {
  if (run_time_ns <= 0) return delays_ns_.front();
  const auto index = static_cast<std::size_t>(run_time_ns / step_ns_);
  if (index + 1 >= delays_ns_.size()) return delays_ns_.back();
  const std::int64_t here = delays_ns_[index];
  if (interpolation_ == Interpolation::kStep) return here;
  // Delays are below 2^40 ns, so the error of the product in a double is far below 1 ns.
  const double share = static_cast<double>(run_time_ns % step_ns_) / static_cast<double>(step_ns_);
  return here +
         static_cast<std::int64_t>(share * static_cast<double>(delays_ns_[index + 1] - here));
}

}  // namespace slambed::link
