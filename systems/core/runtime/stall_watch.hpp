// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "base/time.hpp"

namespace slambed {

/// A transport counts as stalled if bytes are in flight and none is acknowledged for this long.
inline constexpr Duration kStall = std::chrono::seconds(1);

/// Notices the stalls of one channel, for its link events "stalled" and "flowing".
class StallWatch {
 public:
  /// Call when nothing is in flight or bytes were just acknowledged. Returns how long a reported
  /// stall lasted if it ends now.
  std::optional<Duration> progress(RunTime now) {
    const Duration since = now - std::exchange(progress_, now);
    return std::exchange(stalled_, false) ? std::optional(since) : std::nullopt;
  }
  /// Returns true once per stall, when it must be reported.
  bool stalls(RunTime now) { return now - progress_ >= kStall && !std::exchange(stalled_, true); }
  bool stalled() const { return stalled_; }
  /// When to call stalls() next.
  RunTime due() const { return progress_ + kStall; }

  static std::string begin_detail() {
    return "nothing acknowledged for " + std::to_string(static_cast<int>(to_ms(kStall))) + " ms";
  }
  static std::string end_detail(Duration lasted) {
    return "after " + std::to_string(static_cast<std::int64_t>(to_ms(lasted))) + " ms";
  }

 private:
  RunTime progress_{};
  bool stalled_ = false;
};

}  // namespace slambed
