// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "base/time.hpp"

namespace slambed {

/// Edge-SLAM's LOCAL_MAP_SIZE.
inline constexpr int kKeyframesPerStep = 6;

/// When the mobile applies a map update.
// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct UpdateRules {
  int min_local_keyframes;  ///< declined while the local map has fewer
  Duration fast_motion{};   ///< Edge-SLAM's 300 ms; 0: never by the age of the last keyframe
  int local_map_size =
      kKeyframesPerStep;  ///< each so many local keyframes make fast motion matter less
  /// DynNetSLAM's: declined while more keyframes per second are made, reason "fast motion" too; 0:
  /// never for that.
  double keyframe_rate_hz = 0;
};

/// Over which keyframe_rate_hz is counted.
inline constexpr Duration kRateWindow = std::chrono::seconds(1);

/// What the mobile knows when an update lies ready.
struct UpdateState {
  bool relocalization = false;  ///< RELOC_MAP rather than MAP_UPDATE
  bool lost = false;
  bool former_edge = false;      ///< the process that sent it is gone
  bool before_recovery = false;  ///< it left before the camera was found, and shows another place
  /// The edge has not yet mapped keyframes deferred during a hand-over.
  bool older_than_deferred_keyframes = false;
  std::uint64_t update = 0, applied = 0;
  std::uint64_t epoch = 0, current_epoch = 0;  ///< of the update, of the mobile
  std::size_t local_keyframes = 0;
  bool new_keyframe = false;  ///< one was created since the last update was applied
  Duration since_keyframe{};
  int keyframes_in_window = 0;  ///< created within kRateWindow
};

/// Whether the keyframe poses of the update are newer than what is known here, also where its map
/// is declined.
bool keeps_poses(const UpdateState& state);

/// Only the reasons for which no map may be made of the update at all (edge, epoch, number,
/// recovery); nothing when there is none. Few keyframes and fast motion were judged when the update
/// began to be applied.
std::optional<std::string_view> obsolete_reason(const UpdateState& state);

/// Nothing when the update is welcome, else why it is declined.
std::optional<std::string_view> update_decline_reason(const UpdateRules& rules,
                                                      const UpdateState& state);

}  // namespace slambed
