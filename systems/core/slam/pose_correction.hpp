// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "map/map.hpp"

namespace slambed {

/// How far back in time a correction reaches.
struct CorrectionWindow {
  double window_s = 5;  ///< before the keyframe that was told; infinite: the whole map moves alike
  bool graded = true;   ///< fading to nothing at the window's begin; false: all of it alike
};

/// What a pose that somebody else found for a keyframe means for the map that has it.
struct PoseCorrection {
  KeyFrameId keyframe;
  SE3 T_new_old;           ///< moves the world as it is at the keyframe and after it
  double magnitude_m = 0;  ///< between both camera centers
  double rotation_deg = 0;
  double since_s = 0;  ///< sequence time of the window's begin: nothing before it moves
  MapDelta delta;
};

/// Puts the keyframe where it was told to be, from where it is in the map now (an error that two
/// answers tell of is thus corrected once), and back-propagates: what is newer moves along in full,
/// older keyframes within the window in part, what is before it not at all. Points go with the
/// newest keyframe that sees them, so that the frames to come find them where they look. Nothing
/// when the map never had the keyframe.
std::optional<PoseCorrection> correct_pose(const MapView& view, KeyFrameId keyframe,
                                           const SE3& T_cw, const CorrectionWindow& window);

}  // namespace slambed
