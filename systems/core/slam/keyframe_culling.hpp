// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// Culls covisibles of a keyframe if nearly all of their close points (mono: all points) are seen
/// by at least three others, at most one octave coarser. Keeps the origin and the keyframe itself.
MapDelta redundant_keyframes(const Map& map, KeyFrameId keyframe, double redundant_share);

}  // namespace slambed
