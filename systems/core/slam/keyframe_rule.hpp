// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "slam/tracker.hpp"

namespace slambed {

/// What the keyframe decision looks at, for one tracked frame.
struct KeyFrameEvidence {
  bool tracked = false;
  int frames_since_keyframe = 0;
  int frames_since_relocalisation = 0;
  bool relocalised_ever = false;
  int keyframes = 0;          ///< in the map
  int inliers = 0;            ///< of the frame
  int reference_matches = 0;  ///< well observed points of the reference keyframe
  int close_tracked = 0;      ///< close features with an inlier point
  int close_untracked = 0;    ///< close features without
};

/// Points of the reference keyframe count from this weight on.
int least_reference_weight(int keyframes);

/// ORB-SLAM2's rule without what the mapper's side knows.
KeyFrameNeed keyframe_need(const TrackerOptions& options, const KeyFrameEvidence& evidence);

/// The whole rule.
bool wants_keyframe(const TrackerOptions& options, const KeyFrameEvidence& evidence,
                    const MapperStatus& mapper);

}  // namespace slambed
