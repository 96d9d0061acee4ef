// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "map/map.hpp"

namespace slambed {

/// How poses carry over from one map to another that shares keyframes with it.
struct MapChange {
  /// Keyframe of the new map to be relative to: the old reference where the new map knows it, else
  /// a neighbor of it or the newest keyframe both know, else the newest of the new map. None when
  /// the new map is empty.
  KeyFrameId reference;
  SE3 T_rw;       ///< its pose in the new map
  SE3 T_old_new;  ///< maps coordinates of the new map to those of the old one, as seen from the
                  ///< shared keyframe
  bool shared = false;
};

/// Edge-SLAM's ways of going on in a new map.
struct MapChangeOptions {
  /// The reference is the newest keyframe of the new map, whatever the old one was.
  bool newest_is_reference = false;
  /// The last pose moves only where the old reference is the newest keyframe of the new map.
  bool only_from_newest = false;
};

MapChange compare_maps(const Map& old_map, const Map& new_map, KeyFrameId old_reference,
                       const MapChangeOptions& options = {});

/// Renames points of the old map to those of the new one: the same id where it lives there, else
/// what a keyframe of both maps now sees as the same feature (the point was fused over there), else
/// none.
void rename_points(const Map& old_map, const Map& new_map, std::span<MapPointId> points);

/// As Edge-SLAM knows points again: those that tracking has made and that the new map has under the
/// same id; points of the edge get a new name with every update there, so that none of them is.
void keep_tracked_points(const Map& new_map, std::span<MapPointId> points);

/// As Edge-SLAM looks them up: ids are collected without gaps and read by the number of the
/// feature, so of n points the k-th goes to feature k where that had one, and features from n on
/// get none (there it reads behind the list's end).
void hand_out_by_rank(std::span<MapPointId> points);

}  // namespace slambed
