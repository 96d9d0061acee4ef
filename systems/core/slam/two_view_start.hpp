// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "slam/keyframe_maker.hpp"
#include "slam/matching.hpp"

namespace slambed {

/// Makes the first map of a camera without depth from two of its frames. The first frame waits for
/// a second with enough parallax; it is replaced if too few of its features are matched.
class TwoViewStart {
 public:
  /// Offers a frame. On success it has a pose and matches, and the delta holds two keyframes, the
  /// waiting frame and this one, with their points; the median depth seen from the first is one.
  std::optional<MapDelta> offer(Frame& frame, TrackerIds& ids);
  /// Forgets the waiting frame.
  void reset() { features_.reset(); }

 private:
  using Pairs = std::vector<std::pair<int, int>>;  ///< features of the first and the second frame

  void wait_with(const Frame& frame);
  void match(const FeatureSet& second);
  MapDelta make_map(const Pairs& pairs, const std::vector<Eigen::Vector3d>& p_w, Frame& frame,
                    TrackerIds& ids) const;

  // The waiting frame.
  std::shared_ptr<const FeatureSet> features_;
  std::uint64_t index_ = 0;
  double timestamp_s_ = 0;
  std::vector<Eigen::Vector2f> expected_;  ///< where its features were seen last

  Matcher matcher_;
  RotationCheck rotation_;
  Pairs pairs_;
};

}  // namespace slambed
