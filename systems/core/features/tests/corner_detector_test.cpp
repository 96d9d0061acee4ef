// SPDX-License-Identifier: Apache-2.0
#include "features/corner_detector.hpp"

#include <gtest/gtest.h>

#include <map>
#include <opencv2/features2d.hpp>
#include <set>
#include <tuple>

#include "test_images.hpp"

namespace slambed {
namespace {

using testing::noise_image;
using testing::padded;
using testing::textured_image;
using Found = std::set<std::tuple<int, int, int>>;  // y, x, response

Found detect(const cv::Mat& image, int threshold, int threshold_min,
             const Kernels& kernels = fastest_kernels()) {
  const PaddedPlane plane = padded(image);
  CornerDetector detector(threshold, threshold_min, kernels);
  std::vector<Corner> corners;
  detector.detect(plane.view(), corners);
  Found found;
  for (const Corner& c : corners) found.insert({c.y, c.x, c.response});
  EXPECT_EQ(found.size(), corners.size()) << "a corner was reported twice";
  return found;
}

Found opencv_fast(const cv::Mat& image, int threshold) {
  std::vector<cv::KeyPoint> keypoints;
  cv::FAST(image, keypoints, threshold, true);
  Found found;
  constexpr int kMargin = DetectionRegion::kMargin;
  for (const auto& k : keypoints)
    if (k.pt.x >= kMargin && k.pt.x < image.cols - kMargin && k.pt.y >= kMargin &&
        k.pt.y < image.rows - kMargin)
      found.insert(
          {static_cast<int>(k.pt.y), static_cast<int>(k.pt.x), static_cast<int>(k.response)});
  return found;
}

TEST(CornerDetector, FindsExactlyTheCornersOfOpenCvOnEveryLevel) {
  ImagePyramid pyramid({1, 1.2f, 1.44f, 1.728f, 2.0736f}, fastest_kernels());
  for (unsigned seed = 1; seed <= 3; ++seed) {
    pyramid.build(testing::view(textured_image(320, 240, seed)));
    for (int level = 0; level < pyramid.levels(); ++level)
      for (const int threshold : {7, 20, 60}) {
        const cv::Mat image = testing::to_mat(pyramid.level(level));
        const Found expected = opencv_fast(image, threshold);
        EXPECT_FALSE(expected.empty());
        EXPECT_EQ(detect(image, threshold, threshold), expected) << "level " << level;
        EXPECT_EQ(detect(image, threshold, threshold, portable_kernels()), expected);
      }
  }
}

TEST(CornerDetector, AgreesWithOpenCvOnNoise) {
  const cv::Mat image = noise_image(203, 151, 5);
  EXPECT_EQ(detect(image, 7, 7), opencv_fast(image, 7));
}

TEST(CornerDetector, FindsFullContrastCorners) {
  for (const int background : {0, 255}) {
    cv::Mat image(100, 120, CV_8U, cv::Scalar(background));
    image.at<std::uint8_t>(40, 30) = static_cast<std::uint8_t>(255 - background);
    cv::rectangle(image, {60, 30}, {90, 55}, cv::Scalar(128), cv::FILLED);
    image.at<std::uint8_t>(30, 60) = static_cast<std::uint8_t>(255 - background);
    const Found expected = opencv_fast(image, 7);
    EXPECT_FALSE(expected.empty());
    EXPECT_EQ(detect(image, 7, 7), expected);
  }
}

TEST(CornerDetector, ACellUsesTheLowThresholdOnlyWhereTheHighOneFindsNothing) {
  const cv::Mat image = textured_image(333, 251, 7) / 4;  // weak contrast gives both kinds of cells
  const Found all = opencv_fast(image, 7), strong = opencv_fast(image, 20);
  const Found kept = detect(image, 20, 7);

  const int width = image.cols - 32, height = image.rows - 32;
  const int cell_w = (width + width / 30 - 1) / (width / 30);
  const int cell_h = (height + height / 30 - 1) / (height / 30);
  const auto cell = [&](const auto& c) {
    return std::pair((std::get<0>(c) - 16) / cell_h, (std::get<1>(c) - 16) / cell_w);
  };
  std::map<std::pair<int, int>, int> strong_in;
  for (const auto& c : strong) ++strong_in[cell(c)];
  Found expected;
  for (const auto& c : all)
    if (std::get<2>(c) >= 20 || strong_in[cell(c)] == 0) expected.insert(c);
  EXPECT_EQ(kept, expected);
  EXPECT_GT(kept.size(), strong.size());
  EXPECT_LT(kept.size(), all.size());
}

TEST(CornerDetector, AnImageWithoutARegionHasNoCorners) {
  EXPECT_TRUE(detect(noise_image(32, 200, 1), 20, 7).empty());
  EXPECT_TRUE(detect(noise_image(200, 20, 1), 20, 7).empty());
}

}  // namespace
}  // namespace slambed
