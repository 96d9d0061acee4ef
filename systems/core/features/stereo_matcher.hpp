// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "features/feature_set.hpp"

namespace slambed {

/// Matches left features to the right image of a rectified pair like ORB-SLAM2: best descriptor
/// near the same row, then sub-pixel patch alignment. Owns its scratch memory.
class StereoMatcher {
 public:
  /// One image of the pair: the output of an extractor and its pyramid.
  struct Side {
    std::span<const RawKeyPoint> keypoints;
    std::span<const Descriptor> descriptors;
    const ImagePyramid& pyramid;
  };

  explicit StereoMatcher(std::shared_ptr<const Sensor> sensor);
  /// Uses the given kernels; the result does not depend on them.
  StereoMatcher(std::shared_ptr<const Sensor> sensor, const Kernels& kernels);

  /// Fills disparity, px at level 0, one per left keypoint; negative without a match.
  void match(const Side& left, const Side& right, std::vector<float>& disparity);

 private:
  struct Match {
    int left, difference;  ///< keypoint index and sum of absolute differences
  };
  void sort_into_rows(const Side& right);
  int best_descriptor(const RawKeyPoint& point, const Descriptor& descriptor, const Side& right);
  void drop_poor_matches(std::vector<float>& disparity);

  std::shared_ptr<const Sensor> sensor_;
  const Kernels& kernels_;
  std::vector<int> row_begin_, row_items_, next_;  ///< right keypoints that may match in each row
  std::vector<int> candidates_;
  std::vector<std::uint16_t> distances_;
  std::vector<Match> matches_;
};

/// Extracts and matches the features of a rectified stereo frame. A keypoint without a match has no
/// depth and no right_u. Each image needs its own extractor. Throws Error for one extractor given
/// twice or an image that does not fit the camera.
std::shared_ptr<const FeatureSet> make_stereo_features(OrbExtractor& left_extractor,
                                                       OrbExtractor& right_extractor,
                                                       StereoMatcher& matcher,
                                                       std::shared_ptr<const Sensor> sensor,
                                                       GrayView left, GrayView right);

}  // namespace slambed
