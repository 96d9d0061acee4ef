// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

namespace slambed::dynnetslam {

/// Where mapping runs (Sossalla et al. 2022, Sec. IV). Tracking always runs on the mobile node.
enum class OffloadingState {
  kOffloading,  ///< OS: mapping on the edge only
  kSafeZone,    ///< SZ: mapping on both sides
  kMobile,      ///< MES: mapping on the mobile node only
};

/// "OS", "SZ" or "MES".
std::string_view to_string(OffloadingState state);

/// RTT limits between the states, in ms; each strategy is one such table. A state is left only when
/// the RTT is strictly beyond the limit.
struct Thresholds {
  bool safe_zone = false;
  double leave_offloading_above = 0;  ///< OS -> SZ, or OS -> MES without a safe zone
  double leave_safe_zone_above = 0;   ///< SZ -> MES
  double leave_mobile_below = 0;      ///< MES -> SZ, or MES -> OS without a safe zone
  double leave_safe_zone_below = 0;   ///< SZ -> OS
};

/// The paper's parameters.
// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct StrategyOptions {
  bool hysteresis;
  bool safe_zone;
  double limit_ms;                        ///< L_OL
  double band_ms;                         ///< B, whole width of the hysteresis
  std::optional<double> safe_limit_ms{};  ///< L_SZ; absent: L_OL - B/2
};

/// Derives the limits of the four strategies (README.md has the table).
/// Throws Error(kBadInput) for limits that are negative, not finite or out of order.
Thresholds thresholds(const StrategyOptions& options);

/// Evaluates the strategy once, with at most one transition. Without an RTT (none measured for too
/// long) the edge is unreliable, so the state moves one step towards kMobile.
OffloadingState next_state(OffloadingState state, std::optional<double> rtt_ms,
                           const Thresholds& limits);

/// The state at the first RTT: kOffloading below the lowest limit, kMobile above the highest,
/// in between kSafeZone where there is one, else kOffloading. Without any RTT: kMobile.
OffloadingState initial_state(std::optional<double> rtt_ms, const Thresholds& limits);

}  // namespace slambed::dynnetslam
