// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "map/map.hpp"

namespace slambed {

/// How poses carry over from one map to another that shares keyframes with it.
struct MapChange {
  /// Reference keyframe in the new map: the old reference if the new map has it, else a covisible
  /// of it or the newest keyframe in both maps, else the newest in the new map. None if the new map
  /// is empty.
  KeyFrameId reference;
  SE3 T_rw;       ///< its pose in the new map
  SE3 T_old_new;  ///< maps coordinates of the new map to those of the old one, as seen from the
                  ///< shared keyframe
  bool shared = false;
};

/// Edge-SLAM's behavior when it continues on a new map.
struct MapChangeOptions {
  /// The reference is the newest keyframe of the new map, whatever the old one was.
  bool newest_is_reference = false;
  /// The last pose moves only if the old reference is the newest keyframe of the new map.
  bool only_from_newest = false;
};

MapChange compare_maps(const Map& old_map, const Map& new_map, KeyFrameId old_reference,
                       const MapChangeOptions& options = {});

/// Replaces point ids of the old map by ids of the new one: the same id if it exists there, else
/// the point at the same feature of a shared keyframe, else none. The latter finds points that were
/// fused in the new map.
void rename_points(const Map& old_map, const Map& new_map, std::span<MapPointId> points);

/// Keeps, like Edge-SLAM, only points that tracking made and that the new map has under the same
/// id. Points of the edge get a new id there with every update, so none of them is kept.
void keep_tracked_points(const Map& new_map, std::span<MapPointId> points);

/// Reproduces Edge-SLAM's lookup, which collects the ids without gaps but reads them by feature
/// index. Of n points the k-th goes to feature k if that had one; features from n on get none
/// (Edge-SLAM reads beyond the end of its list there).
void hand_out_by_rank(std::span<MapPointId> points);

}  // namespace slambed
