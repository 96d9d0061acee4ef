// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/update_rules.hpp"

#include <utility>

namespace slambed {
namespace {

// Edge-SLAM's limit is 300 ms / (local keyframes / 6 + 1); below 50 ms there is none.
constexpr Duration kShortest = std::chrono::milliseconds(50);

}  // namespace

bool keeps_poses(const UpdateState& state) {
  return !state.former_edge && state.epoch >= state.current_epoch && state.update > state.applied;
}

std::optional<std::string_view> obsolete_reason(const UpdateState& state) {
  if (state.former_edge) return "its edge is gone";
  if (state.epoch < state.current_epoch) return "older epoch";
  if (state.update <= state.applied) return "older than the map";
  if (state.before_recovery) return "from before the recovery";
  return std::nullopt;
}

std::optional<std::string_view> update_decline_reason(const UpdateRules& rules,
                                                      const UpdateState& state) {
  if (const auto obsolete = obsolete_reason(state)) return obsolete;
  if (state.relocalization) {
    if (!state.lost) return "not lost any more";
    return std::nullopt;
  }
  if (state.older_than_deferred_keyframes) return "the edge catches up";
  if (std::cmp_less(state.local_keyframes, rules.min_local_keyframes)) return "few keyframes";
  if (!state.new_keyframe) return "up to date";
  const Duration limit =
      rules.fast_motion /
      (static_cast<std::int64_t>(state.local_keyframes) / rules.local_map_size + 1);
  if (limit >= kShortest && state.since_keyframe < limit) return "fast motion";
  if (rules.keyframe_rate_hz > 0 &&
      state.keyframes_in_window > rules.keyframe_rate_hz * to_seconds(kRateWindow)) {
    return "many keyframes";
  }
  return std::nullopt;
}

}  // namespace slambed
