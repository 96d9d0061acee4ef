// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "slam/tracker.hpp"

namespace slambed {

/// Points of the reference keyframe count from this weight on: well observed ones, but all of them
/// in a young map or where frames are so far apart that few points are ever seen often. A local map
/// that an edge made of one keyframe of a single camera has none that weighs more than one.
int least_reference_weight(const KeyFrameEvidence& evidence);

/// ORB-SLAM2's rule without what the mapper's side knows.
KeyFrameNeed keyframe_need(const TrackerOptions& options, const KeyFrameEvidence& evidence);

/// The whole rule.
bool wants_keyframe(const TrackerOptions& options, const KeyFrameEvidence& evidence,
                    const MapperStatus& mapper);

}  // namespace slambed
