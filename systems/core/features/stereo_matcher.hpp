// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "features/feature_set.hpp"

namespace slambed {

/// Finds the right image's column of left features in a rectified pair: best descriptor near the
/// same row, then a sub-pixel patch comparison (ORB-SLAM2's way). Owns its scratch memory.
class StereoMatcher {
 public:
  /// One image of the pair: what an extractor found and the pyramid it still holds.
  struct Side {
    std::span<const RawKeyPoint> keypoints;
    std::span<const Descriptor> descriptors;
    const ImagePyramid& pyramid;
  };

  explicit StereoMatcher(std::shared_ptr<const Sensor> sensor);
  /// With chosen inner loops; the result does not depend on them.
  StereoMatcher(std::shared_ptr<const Sensor> sensor, const Kernels& kernels);

  /// Fills disparity (px at level 0, one per left keypoint); negative where nothing fits.
  void match(const Side& left, const Side& right, std::vector<float>& disparity);

 private:
  struct Match {
    int left, difference;  ///< keypoint and sum of absolute differences
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

/// Extraction of both images and matching for a rectified stereo frame; a keypoint without a match
/// has neither depth nor right_u. The extractors must be two. Throws Error when an image does not
/// fit the camera or the camera is not that of a rectified pair.
std::shared_ptr<const FeatureSet> make_stereo_features(OrbExtractor& left_extractor,
                                                       OrbExtractor& right_extractor,
                                                       StereoMatcher& matcher,
                                                       std::shared_ptr<const Sensor> sensor,
                                                       GrayView left, GrayView right);

}  // namespace slambed
