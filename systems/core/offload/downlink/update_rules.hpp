// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "base/time.hpp"

namespace slambed {

/// Edge-SLAM's LOCAL_MAP_SIZE.
inline constexpr int kKeyframesPerStep = 6;

/// Limits that decide whether the mobile applies a map update.
// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct UpdateRules {
  int min_local_keyframes;  ///< declined while the local map has fewer
  Duration fast_motion{};   ///< Edge-SLAM: 300 ms; 0: the age of the last keyframe declines nothing
  int local_map_size =
      kKeyframesPerStep;  ///< the limit is fast_motion / (local keyframes / this + 1)
  /// DynNetSLAM: declines while more keyframes a second are made, as in fast motion; 0: never.
  double keyframe_rate_hz = 0;
};

/// Time window in which keyframe_rate_hz is counted.
inline constexpr Duration kRateWindow = std::chrono::seconds(1);

/// What the mobile knows when an update is ready to be applied.
struct UpdateState {
  bool relocalization = false;  ///< RELOC_MAP rather than MAP_UPDATE
  bool lost = false;
  bool former_edge = false;      ///< the process that sent it is gone
  bool before_recovery = false;  ///< sent before the camera was relocalized; shows another place
  /// The edge has not yet mapped keyframes deferred during a hand-over.
  bool older_than_deferred_keyframes = false;
  std::uint64_t update = 0, applied = 0;
  std::uint64_t epoch = 0, current_epoch = 0;  ///< of the update, of the mobile
  std::size_t local_keyframes = 0;
  bool new_keyframe = false;  ///< one was created since the last update was applied
  Duration since_keyframe{};
  int keyframes_in_window = 0;  ///< created within kRateWindow
};

/// Returns whether the update's poses are newer than those known, even if its map is declined.
bool keeps_poses(const UpdateState& state);

/// Returns why no update may be applied in this state at all (edge, epoch, number, recovery), or
/// nothing. Few keyframes and fast motion were checked when the update began to be applied.
std::optional<std::string_view> obsolete_reason(const UpdateState& state);

/// Returns the reason why the update is declined, or nothing.
std::optional<std::string_view> update_decline_reason(const UpdateRules& rules,
                                                      const UpdateState& state);

}  // namespace slambed
