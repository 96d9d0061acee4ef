// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"
#include "offload/downlink/update_rules.hpp"

namespace slambed {

/// Where Edge-SLAM's own code behaves otherwise than our systems: one switch each, by default ours.
/// Sources (lines of that code) stand beside the parameters in edgeslam/system.yaml.
struct OriginalBehavior {
  int local_map_size = kKeyframesPerStep;  ///< LOCAL_MAP_SIZE, as the fast-motion rule takes it
  int max_frames = 0;                      ///< mMaxFrames; 0: a second at the played rate
  bool admission_when_idle = false;        ///< keyframes wait unread until the mapper looks
  bool point_age_by_keyframe_id = false;   ///< ages of new points are differences of keyframe ids
  bool updates_after_extraction = false;   ///< the mobile looks for an update then, not before
  double first_update_s = -1;              ///< negative: one period after the start
  TrackerOptions tracker;                  ///< of which only the switches are set
};

/// What the parameters ask for; ours where the system does not offer the switches.
OriginalBehavior original_behavior(const Parameters& parameters);

}  // namespace slambed
