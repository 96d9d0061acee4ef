// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/strategy.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"

namespace slambed::dynnetslam {

std::string_view to_string(OffloadingState state) {
  switch (state) {
    case OffloadingState::kOffloading:
      return "OS";
    case OffloadingState::kSafeZone:
      return "SZ";
    case OffloadingState::kMobile:
      return "MES";
  }
  return "?";
}

Thresholds thresholds(const StrategyOptions& o) {
  const double half = o.band_ms / 2;
  const double safe = o.safe_limit_ms.value_or(o.limit_ms - half);
  if (!std::isfinite(o.limit_ms) || !std::isfinite(o.band_ms) || !std::isfinite(safe) ||
      o.band_ms < 0 || safe < 0 || safe > o.limit_ms || o.limit_ms - half < 0) {
    throw bad_input("dynnetslam: l_ol_ms " + std::to_string(o.limit_ms) + ", b_ms " +
                    std::to_string(o.band_ms) + ", l_sz_ms " + std::to_string(safe) +
                    " are out of order: need 0 <= l_sz_ms <= l_ol_ms and 0 <= b_ms/2 <= l_ol_ms");
  }
  if (!o.safe_zone) {
    const double offset = o.hysteresis ? half : 0;
    return {.safe_zone = false,
            .leave_offloading_above = o.limit_ms + offset,
            .leave_safe_zone_above = o.limit_ms,
            .leave_mobile_below = o.limit_ms - offset,
            .leave_safe_zone_below = o.limit_ms};
  }
  if (!o.hysteresis) {
    return {.safe_zone = true,
            .leave_offloading_above = safe,
            .leave_safe_zone_above = o.limit_ms,
            .leave_mobile_below = o.limit_ms,
            .leave_safe_zone_below = safe};
  }
  return {.safe_zone = true,
          .leave_offloading_above = safe,
          .leave_safe_zone_above = o.limit_ms,
          .leave_mobile_below = safe,
          .leave_safe_zone_below = std::max(0.0, safe - half)};
}

OffloadingState next_state(OffloadingState state, std::optional<double> rtt_ms,
                           const Thresholds& limits) {
  // An unknown RTT compares as infinite: every "above" test fires, no "below" test does.
  const double rtt = rtt_ms.value_or(INFINITY);
  const OffloadingState towards_mobile =
      limits.safe_zone ? OffloadingState::kSafeZone : OffloadingState::kMobile;
  const OffloadingState towards_edge =
      limits.safe_zone ? OffloadingState::kSafeZone : OffloadingState::kOffloading;
  switch (state) {
    case OffloadingState::kOffloading:
      return rtt > limits.leave_offloading_above ? towards_mobile : state;
    case OffloadingState::kSafeZone:
      if (rtt > limits.leave_safe_zone_above) return OffloadingState::kMobile;
      return rtt < limits.leave_safe_zone_below ? OffloadingState::kOffloading : state;
    case OffloadingState::kMobile:
      return rtt < limits.leave_mobile_below ? towards_edge : state;
  }
  return state;
}

OffloadingState initial_state(std::optional<double> rtt_ms, const Thresholds& limits) {
  const double rtt = rtt_ms.value_or(INFINITY);
  const double lowest = limits.safe_zone
                            ? std::min(limits.leave_safe_zone_below, limits.leave_mobile_below)
                            : limits.leave_mobile_below;
  const double highest =
      limits.safe_zone ? limits.leave_safe_zone_above : limits.leave_offloading_above;
  if (rtt < lowest) return OffloadingState::kOffloading;
  if (rtt > highest) return OffloadingState::kMobile;
  return limits.safe_zone ? OffloadingState::kSafeZone : OffloadingState::kOffloading;
}

}  // namespace slambed::dynnetslam
