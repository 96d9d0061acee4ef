// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"

namespace slambed {

/// Keyframe culling: covisibles of a keyframe nearly all of whose close points (without depth: all)
/// are seen as well or better by at least three others. The origin and the keyframe itself stay.
MapDelta redundant_keyframes(const Map& map, KeyFrameId keyframe, double redundant_share);

}  // namespace slambed
