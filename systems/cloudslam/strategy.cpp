// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/strategy.hpp"

#include <algorithm>
#include <string>

#include "base/error.hpp"

namespace slambed::cloudslam {

Strategy::Strategy(const StrategyOptions& options) : options_(options) {
  const auto need = [](bool good, const std::string& what) {
    if (!good) throw bad_input("params: " + what);
  };
  const bool by_distance =
      options.kind == StrategyKind::kDistance || options.kind == StrategyKind::kAdaptive;
  need(options.kind != StrategyKind::kPeriodic || options.period_s > 0,
       "strategy periodic needs period_s above 0");
  need(!by_distance || options.distance_m > 0,
       "strategies distance and adaptive need distance_m above 0");
  if (options.kind != StrategyKind::kAdaptive) return;
  need(options.correction_threshold_m > 0,
       "strategy adaptive needs correction_threshold_m above 0");
  need(options.decrease > 0 && options.decrease <= 1, "decrease must be above 0 and at most 1");
  need(options.increase >= 1, "increase must be at least 1");
  need(options.distance_min_m <= options.distance_m && options.distance_m <= options.distance_max_m,
       "distance_m must lie between distance_min_m and distance_max_m");
}

bool Strategy::next(const StrategyState& state, const Moment& keyframe) const {
  if (options_.kind == StrategyKind::kNone) return false;
  if (options_.kind == StrategyKind::kAll || !state.last_sent) return true;
  if (options_.kind == StrategyKind::kPeriodic)
    return keyframe.seq_s - state.last_sent->seq_s >= options_.period_s;
  return keyframe.traveled_m - state.last_sent->traveled_m >= state.distance_m;
}

StrategyState Strategy::sent(StrategyState state, const Moment& keyframe) {
  state.last_sent = keyframe;
  return state;
}

StrategyState Strategy::answered(StrategyState state, double magnitude_m) const {
  if (!adapts()) return state;
  const double factor =
      magnitude_m > options_.correction_threshold_m ? options_.decrease : options_.increase;
  state.distance_m =
      std::clamp(state.distance_m * factor, options_.distance_min_m, options_.distance_max_m);
  return state;
}

}  // namespace slambed::cloudslam
