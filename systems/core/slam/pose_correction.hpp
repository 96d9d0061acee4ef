// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "map/map.hpp"

namespace slambed {

/// How far back in time a correction reaches.
struct CorrectionWindow {
  double window_s = 5;  ///< before the corrected keyframe; infinite: the whole map moves alike
  bool graded = true;   ///< fades to zero at the window's start; false: all of it moves alike
};

/// Effect of a pose that was found elsewhere for a keyframe on the map that has it.
struct PoseCorrection {
  KeyFrameId keyframe;
  SE3 T_new_old;           ///< moves the world at the keyframe and after it
  double magnitude_m = 0;  ///< between the old and the new camera center
  double rotation_deg = 0;
  double since_s = 0;  ///< sequence time of the window's start; nothing older moves
  MapDelta delta;
};

/// Moves the keyframe to T_cw and propagates the change back in time. The change is relative to its
/// current pose in the map, so an error that two answers report is corrected only once. Newer
/// keyframes move fully, older ones within the window partly, those before it not at all. Points
/// move with the newest keyframe that sees them, so that later frames find them. Returns nothing if
/// the map never had the keyframe.
std::optional<PoseCorrection> correct_pose(const MapView& view, KeyFrameId keyframe,
                                           const SE3& T_cw, const CorrectionWindow& window);

}  // namespace slambed
