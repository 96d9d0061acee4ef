// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace slambed {

/// Input of the keyframe decision for one tracked frame.
struct KeyFrameEvidence {
  bool tracked = false;
  bool metric = true;  ///< depth is measured, so an observation with depth has weight two
  int frames_since_keyframe = 0;
  int frames_since_relocalization = 0;
  bool relocalized_ever = false;
  int keyframes = 0;          ///< in the map
  int inliers = 0;            ///< of the frame
  int reference_matches = 0;  ///< well observed points of the reference keyframe
  int close_tracked = 0;      ///< close features with an inlier point
  int close_untracked = 0;    ///< close features without one
  /// The motion model failed. The camera moves far between frames, so the next frame may share few
  /// points with the map.
  bool unpredicted = false;
};

}  // namespace slambed
