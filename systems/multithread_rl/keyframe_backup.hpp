// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unordered_map>

#include "map/map.hpp"

namespace slambed {

/// How the world moved between two maps that share keyframes: one transformation per shared
/// keyframe. What an update brings where it corrects the map is not one movement of all.
class SharedKeyFrames {
 public:
  SharedKeyFrames() = default;
  SharedKeyFrames(const Map& from, const Map& to);

  /// Maps old world coordinates to new ones, as seen from the keyframe; null: not in both maps.
  const SE3* movement(KeyFrameId keyframe) const;
  /// As seen from the newest keyframe of both; identity: they share none.
  const SE3& newest() const { return newest_; }
  void add(KeyFrameId keyframe, const SE3& movement) { movements_[keyframe] = movement; }

 private:
  std::unordered_map<KeyFrameId, SE3> movements_;  ///< T_new_old
  SE3 newest_;
};

/// A keyframe of one map as it belongs into the other, with all points it sees that the other one
/// lacks: moved as the shared keyframe that sees most of the same points, points that were fused
/// over there named by their survivor. Empty when it is gone here or known there. Notes its own
/// movement.
MapDelta carry_over(const Map& from, const Map& to, KeyFrameId keyframe, SharedKeyFrames& shared);

}  // namespace slambed
