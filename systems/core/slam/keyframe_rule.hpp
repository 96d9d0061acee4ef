// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "slam/tracker.hpp"

namespace slambed {

/// Minimum weight at which a point of the reference keyframe counts. It is lower in a young map,
/// and if frames are so far apart that few points are ever seen often. In a monocular local map
/// that an edge made of one keyframe, no point weighs more than one.
int least_reference_weight(const KeyFrameEvidence& evidence);

/// ORB-SLAM2's rule without the conditions on the mapper.
KeyFrameNeed keyframe_need(const TrackerOptions& options, const KeyFrameEvidence& evidence);

/// The whole rule.
bool wants_keyframe(const TrackerOptions& options, const KeyFrameEvidence& evidence,
                    const MapperStatus& mapper);

}  // namespace slambed
