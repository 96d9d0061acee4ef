// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unordered_map>

#include "map/map.hpp"

namespace slambed {

/// How the world moved between two maps that share keyframes, as one transformation for each of
/// them. An update that corrects the map does not move all of it alike.
class SharedKeyFrames {
 public:
  SharedKeyFrames() = default;
  SharedKeyFrames(const Map& from, const Map& to);

  /// Maps old world coordinates to new ones, as seen from the keyframe; null: not in both maps.
  const SE3* movement(KeyFrameId keyframe) const;
  /// The movement at the newest shared keyframe; identity if there is none.
  const SE3& newest() const { return newest_; }
  void add(KeyFrameId keyframe, const SE3& movement) { movements_[keyframe] = movement; }

 private:
  std::unordered_map<KeyFrameId, SE3> movements_;  ///< T_new_old
  SE3 newest_;
};

/// Adapts a keyframe of `from` to the map `to`, with all points it sees that `to` lacks. It moves
/// as the shared keyframe does that sees the most of the same points; points fused in `to` are
/// replaced by their survivor. Returns an empty delta if the keyframe is gone in `from` or already
/// in `to`. Adds its movement to `shared`.
MapDelta carry_over(const Map& from, const Map& to, KeyFrameId keyframe, SharedKeyFrames& shared);

}  // namespace slambed
