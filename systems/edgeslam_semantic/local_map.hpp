// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <set>

#include "edgeslam_semantic/map_window.hpp"
#include "geometry/sim3.hpp"

namespace slambed::edgeslam_semantic {

/// What only the mobile knows of a keyframe; slices do not carry it.
struct OwnKeyFrame {
  std::uint64_t frame_index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
};

/// Erases own keyframes that are not newer than the slice's keyframe `newest` and not in the
/// window: the edge has deleted them, or they left the window, and neither kind returns to it.
void forget_left(std::map<KeyFrameId, OwnKeyFrame>& own, const MapWindow& window,
                 KeyFrameId newest);

/// Returns the transform from the mobile's world to the slice's world that maps the rough pose of a
/// shared keyframe onto its optimized pose. Its scale is the median ratio of the distances from
/// that keyframe to the shared points. It is 1 with fewer than 15 points or within 0.5 % of 1.
Sim3 correction_at(const MapView& rough, KeyFrameId keyframe, const MapWindow& optimized);

/// Input of the mobile's new local map after a slice.
struct LocalMapParts {
  const MapWindow& window;
  const std::map<KeyFrameId, OwnKeyFrame>& own;  ///< window keyframes missing here are skipped
  KeyFrameId newest;                             ///< keyframe of the slice; newer ones are kept
  Sim3 S_new_old;                                ///< moves what is kept
  std::set<MapPointId> gone;  ///< points to drop: deleted by the edge, or on something that moves
};

/// Returns the window plus, from the map before, the keyframes newer than the slice and their
/// points, moved by S_new_old. Where the window has another point at the same feature of the same
/// keyframe, it replaces the mobile's own point.
MapDelta local_map(const MapView& before, const LocalMapParts& parts);

}  // namespace slambed::edgeslam_semantic
