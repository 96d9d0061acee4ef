// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace slambed {

/// What the keyframe decision looks at, for one tracked frame.
struct KeyFrameEvidence {
  bool tracked = false;
  bool metric = true;  ///< depth is measured: an observation with it weighs two
  int frames_since_keyframe = 0;
  int frames_since_relocalization = 0;
  bool relocalized_ever = false;
  int keyframes = 0;          ///< in the map
  int inliers = 0;            ///< of the frame
  int reference_matches = 0;  ///< well observed points of the reference keyframe
  int close_tracked = 0;      ///< close features with an inlier point
  int close_untracked = 0;    ///< close features without
  /// The motion model failed: the camera moves far between frames, and the next one may share less
  /// with the map than the map can tell.
  bool unpredicted = false;
};

}  // namespace slambed
