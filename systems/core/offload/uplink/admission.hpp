// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "base/time.hpp"
#include "map/map.hpp"
#include "slam/tracker.hpp"
#include "wire/messages.hpp"

namespace slambed {

/// What the edge knows when a keyframe arrives.
struct AdmissionState {
  MapperStatus mapper;
  std::size_t keyframes = 0;    ///< in the global map
  double last_accepted_s = -1;  ///< sequence time; negative: none yet
  double played_fps = 30;
  int queue_limit = 3;  ///< keyframes that may wait for the mapper
  int max_frames = 0;   ///< ORB-SLAM2's mMaxFrames; 0: one second of frames
};

/// Decline reason for a keyframe that arrives before any that can start a map.
inline constexpr std::string_view kNoMap = "not the first keyframe";

/// Applies the edge's half of ORB-SLAM2's keyframe rule, as Edge-SLAM splits it. Returns the reason
/// why the keyframe is declined, or nothing. Conditions and constants: systems/edgeslam/README.md.
std::optional<std::string_view> keyframe_decline_reason(const wire::KeyFrameMessage& message,
                                                        const AdmissionState& state);

/// Adapts the delta so that it can be committed to a map that has changed since the mobile made it.
/// Points fused meanwhile are replaced by their survivor; points that were culled or never arrived
/// are removed. No keyframe sees a point twice.
MapDelta rebase_keyframe(const MapView& view, MapDelta delta);

}  // namespace slambed
