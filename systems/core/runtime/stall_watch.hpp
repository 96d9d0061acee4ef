// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "base/time.hpp"

namespace slambed {

/// A transport that has bytes under way of which none is acknowledged for so long counts as
/// stalled.
inline constexpr Duration kStall = std::chrono::seconds(1);

/// Notices the stalls of one channel, for its link events "stalled" and "flowing".
class StallWatch {
 public:
  /// Nothing is under way, or something was acknowledged just now. How long a stall lasted that was
  /// told and ends with this.
  std::optional<Duration> progress(RunTime now) {
    const Duration since = now - std::exchange(progress_, now);
    return std::exchange(stalled_, false) ? std::optional(since) : std::nullopt;
  }
  /// True once per stall, when it is time to tell it.
  bool stalls(RunTime now) { return now - progress_ >= kStall && !std::exchange(stalled_, true); }
  bool stalled() const { return stalled_; }
  /// When to look again.
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
