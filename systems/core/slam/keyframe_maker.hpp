// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "map/map.hpp"
#include "slam/frame.hpp"

namespace slambed {

/// Which features of a keyframe become points.
enum class NewPoints {
  kAllWithDepth,    ///< the first keyframe
  kCloseOrNearest,  ///< all close ones, and at least the hundred nearest
};

/// Id sources for the elements that a tracker creates.
struct TrackerIds {
  explicit TrackerIds(IdSpace space) : keyframes(space), points(space) {}
  IdSource<KeyFrameId> keyframes;
  IdSource<MapPointId> points;
};

/// Returns the delta that makes a keyframe of the frame at T_cw: its matches, and new points from
/// depth for unmatched features. Adds the new points to frame.points too.
MapDelta make_keyframe(const Map& map, Frame& frame, const SE3& T_cw, NewPoints rule,
                       TrackerIds& ids);

}  // namespace slambed
