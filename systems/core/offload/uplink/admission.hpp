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
  int max_frames = 0;   ///< ORB-SLAM2's mMaxFrames; 0: a second at the played rate
};

/// The reason when a keyframe came before any that a map can start with.
inline constexpr std::string_view kNoMap = "not the first keyframe";

/// Edge-SLAM's second half of ORB-SLAM2's keyframe rule: nothing when the keyframe is welcome, else
/// why it is not. Conditions and constants: systems/edgeslam/README.md.
std::optional<std::string_view> keyframe_decline_reason(const wire::KeyFrameMessage& message,
                                                        const AdmissionState& state);

/// The delta as it can be committed to a map that went on without the mobile: points that were
/// fused meanwhile are named by their survivor, points that were culled or never came are
/// forgotten, none is seen twice.
MapDelta rebase_keyframe(const MapView& view, MapDelta delta);

}  // namespace slambed
