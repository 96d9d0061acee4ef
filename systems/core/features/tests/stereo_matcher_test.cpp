// SPDX-License-Identifier: Apache-2.0
#include "features/stereo_matcher.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "features/kernels.hpp"
#include "test_images.hpp"

namespace slambed {
namespace {

constexpr double kFx = 500, kBf = 60;

std::shared_ptr<const Sensor> stereo_sensor(double bf = kBf, double k1 = 0) {
  auto s = std::make_shared<Sensor>();
  s->camera = {.width = 640, .height = 480, .fx = kFx, .fy = kFx, .cx = 320, .cy = 240, .bf = bf};
  s->camera.distortion[0] = k1;
  s->bounds = undistorted_bounds(s->camera);
  return s;
}

/// A wall seen at an angle, with disparity base + slope_x * x + slope_y * y at left pixel (x, y).
struct Wall {
  double base, slope_x, slope_y;
  double disparity(double x, double y) const { return base + slope_x * x + slope_y * y; }
  cv::Mat right_image(const cv::Mat& left) const {
    cv::Mat map_x(left.size(), CV_32F), map_y(left.size(), CV_32F), right;
    for (int y = 0; y < left.rows; ++y)
      for (int x = 0; x < left.cols; ++x) {
        // Right pixel x shows left pixel u with u - disparity(u, y) = x.
        map_x.at<float>(y, x) = static_cast<float>((x + base + slope_y * y) / (1 - slope_x));
        map_y.at<float>(y, x) = static_cast<float>(y);
      }
    cv::remap(left, right, map_x, map_y, cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
    return right;
  }
};

class StereoTest : public ::testing::Test {
 protected:
  std::shared_ptr<const FeatureSet> features(const cv::Mat& left, const cv::Mat& right,
                                             std::shared_ptr<const Sensor> s = stereo_sensor()) {
    StereoMatcher matcher(s);
    return make_stereo_features(left_, right_, matcher, s, testing::view(left),
                                testing::view(right));
  }
  OrbExtractor left_{OrbOptions{}}, right_{OrbOptions{}};
};

TEST_F(StereoTest, FindsTheDisparityOfWalls) {
  const cv::Mat left = testing::textured_image(640, 480, 11);
  for (const Wall wall : {Wall{12, 0, 0}, Wall{30.4, 0, 0}, Wall{8, 0.05, 0}, Wall{6, 0, 0.05},
                          Wall{3.3, 0.01, 0.02}}) {
    const auto set = features(left, wall.right_image(left));
    std::vector<double> errors;
    for (const KeyPoint& p : set->keypoints()) {
      if (!p.has_depth()) {
        EXPECT_EQ(p.right_u, -1);
        continue;
      }
      EXPECT_NEAR(p.depth_m, kBf / (p.u - p.right_u), 1e-2 * p.depth_m);
      errors.push_back(std::abs(p.u - p.right_u - wall.disparity(p.u, p.v)) /
                       set->sensor().pyramid.scale[p.octave]);
    }
    ASSERT_GT(errors.size(), 400u) << wall.base;
    std::sort(errors.begin(), errors.end());
    EXPECT_LT(errors[errors.size() / 2], 0.15) << "median, px of the level";
    EXPECT_LT(errors[errors.size() * 95 / 100], 0.8) << wall.base;
  }
}

TEST_F(StereoTest, FarAwayEverythingHasLeastDisparityOrNone) {
  const cv::Mat left = testing::textured_image(640, 480, 12);
  const auto set = features(left, left);
  int far = 0;
  for (const KeyPoint& p : set->keypoints()) {
    if (!p.has_depth()) continue;
    ++far;
    EXPECT_LE(p.u - p.right_u, 0.51f * set->sensor().pyramid.scale[p.octave]);
  }
  EXPECT_GT(far, 300);
}

TEST_F(StereoTest, UnrelatedImagesHardlyMatch) {
  const auto set =
      features(testing::textured_image(640, 480, 13), testing::noise_image(640, 480, 1));
  const auto matched = std::count_if(set->keypoints().begin(), set->keypoints().end(),
                                     [](const KeyPoint& p) { return p.has_depth(); });
  EXPECT_LT(matched, 100);
}

TEST_F(StereoTest, NothingBehindTheOppositeShift) {
  // The images are swapped, so every true disparity is negative.
  const cv::Mat left = testing::textured_image(640, 480, 14);
  const auto set = features(Wall{40, 0, 0}.right_image(left), left);
  const auto matched = std::count_if(set->keypoints().begin(), set->keypoints().end(),
                                     [](const KeyPoint& p) { return p.has_depth(); });
  EXPECT_LT(matched, 100);
}

TEST_F(StereoTest, BlackImagesGiveAnEmptySet) {
  const cv::Mat black(480, 640, CV_8U, cv::Scalar(0));
  EXPECT_EQ(features(black, black)->size(), 0);
  const auto set = features(testing::textured_image(640, 480, 1), black);
  for (const KeyPoint& p : set->keypoints()) EXPECT_FALSE(p.has_depth());
}

TEST_F(StereoTest, SameImagesSameResult) {
  const cv::Mat left = testing::textured_image(640, 480, 15);
  const cv::Mat right = Wall{8, 0.05, 0}.right_image(left);
  const auto sensor = stereo_sensor();
  StereoMatcher matcher(sensor);
  const auto once = features(left, right);
  for (int round = 0; round < 2; ++round) {
    const auto again = make_stereo_features(left_, right_, matcher, sensor, testing::view(left),
                                            testing::view(right));
    ASSERT_EQ(once->size(), again->size());
    for (int i = 0; i < once->size(); ++i)
      ASSERT_EQ(once->keypoint(i).right_u, again->keypoint(i).right_u);
  }
}

TEST_F(StereoTest, AllKernelsFindTheSameDisparities) {
  const cv::Mat left = testing::textured_image(640, 480, 16);
  const cv::Mat right = Wall{8, 0.05, 0}.right_image(left);
  const auto sensor = stereo_sensor();
  const auto fast = features(left, right);
  StereoMatcher portable(sensor, portable_kernels());
  const auto plain = make_stereo_features(left_, right_, portable, sensor, testing::view(left),
                                          testing::view(right));
  ASSERT_EQ(fast->size(), plain->size());
  for (int i = 0; i < fast->size(); ++i)
    EXPECT_EQ(fast->keypoint(i).right_u, plain->keypoint(i).right_u);
}

TEST_F(StereoTest, RefusesWhatIsNoRectifiedPair) {
  const cv::Mat image = testing::textured_image(640, 480, 1);
  const cv::Mat small = testing::textured_image(320, 240, 1);
  EXPECT_THROW(features(image, small), Error);
  EXPECT_THROW(features(small, image), Error);
  EXPECT_THROW(StereoMatcher(stereo_sensor(0)), Error);
  EXPECT_THROW(StereoMatcher(stereo_sensor(kBf, 0.1)), Error);
  EXPECT_THROW(StereoMatcher(nullptr), Error);
  const auto sensor = stereo_sensor();
  StereoMatcher matcher(sensor);
  EXPECT_THROW(make_stereo_features(left_, left_, matcher, sensor, testing::view(image),
                                    testing::view(image)),
               Error);
}

}  // namespace
}  // namespace slambed
