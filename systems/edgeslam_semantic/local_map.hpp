// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <set>

#include "edgeslam_semantic/map_window.hpp"
#include "geometry/sim3.hpp"

namespace slambed::edgeslam_semantic {

/// A keyframe as only the mobile has it whole.
struct OwnKeyFrame {
  std::uint64_t frame_index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
};

/// Keyframes up to the slice's that are not in the window go, with their features: those older than
/// all of it, which the edge lets come back no more, and those that it has deleted. newest:
/// keyframe of the slice.
void forget_left(std::map<KeyFrameId, OwnKeyFrame>& own, const MapWindow& window,
                 KeyFrameId newest);

/// The move from the world as the mobile has it to the one that a slice knows, as seen from a
/// keyframe that both have: its rough pose becomes the optimized one. The scale is that of the
/// points that both have (median of their distances from the keyframe); within half a percent of 1,
/// or with few of them, it is 1.
Sim3 correction_at(const MapView& rough, KeyFrameId keyframe, const MapWindow& optimized);

/// What the mobile's local map is made of after a slice.
struct LocalMapParts {
  const MapWindow& window;
  const std::map<KeyFrameId, OwnKeyFrame>& own;  ///< all keyframes of the window are here
  KeyFrameId newest;                             ///< keyframe of the slice: what is newer stays
  Sim3 S_new_old;                                ///< moves what stays
  std::set<MapPointId> gone;  ///< points that do not stay: deleted on the edge, or on what moves
};

/// The window, and of the map as it was the keyframes that are newer than the slice with the points
/// that they see, moved. A point of the mobile's own that the window has another one for (the same
/// feature of the same keyframe) becomes that one.
MapDelta local_map(const MapView& before, const LocalMapParts& parts);

}  // namespace slambed::edgeslam_semantic
