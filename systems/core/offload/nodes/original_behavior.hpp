// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"
#include "offload/downlink/update_rules.hpp"

namespace slambed {

/// One switch for each behavior in which Edge-SLAM's own code differs from our systems; the
/// defaults are ours. edgeslam/system.yaml names the lines of that code for each.
struct OriginalBehavior {
  int local_map_size = kKeyframesPerStep;  ///< LOCAL_MAP_SIZE in the fast-motion rule
  int max_frames = 0;                      ///< ORB-SLAM2's mMaxFrames; 0: one second of frames
  bool admission_when_idle = false;        ///< keyframes wait unparsed until the mapper looks
  bool point_age_by_keyframe_id = false;   ///< ages of new points are differences of keyframe ids
  bool updates_after_extraction = false;   ///< the mobile looks for updates then, not before
  double first_update_s = -1;              ///< negative: one period after the start
  TrackerOptions tracker;                  ///< only its switches are set
};

/// Reads the switches from the parameters; returns the defaults for a system without them.
OriginalBehavior original_behavior(const Parameters& parameters);

}  // namespace slambed
