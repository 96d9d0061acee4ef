// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

namespace slambed {

/// Durations and timestamps are integer nanoseconds. A timestamp is in run time: zero is the start
/// of playback, shared by both nodes, the link and the sampler.
using Duration = std::chrono::nanoseconds;
using RunTime = std::chrono::nanoseconds;

inline constexpr RunTime kNever = RunTime::max();

constexpr double to_seconds(Duration d) { return std::chrono::duration<double>(d).count(); }
constexpr double to_ms(Duration d) { return std::chrono::duration<double, std::milli>(d).count(); }
constexpr Duration from_seconds(double s) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(s));
}

}  // namespace slambed
