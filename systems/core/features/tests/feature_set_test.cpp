// SPDX-License-Identifier: Apache-2.0
#include "features/feature_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "base/error.hpp"
#include "test_images.hpp"

namespace slambed {
namespace {

std::shared_ptr<const Sensor> sensor(std::array<double, 5> distortion = {}) {
  auto s = std::make_shared<Sensor>();
  s->camera = {.width = 640, .height = 480, .fx = 517, .fy = 516, .cx = 318, .cy = 255, .bf = 40};
  s->camera.distortion = distortion;
  s->bounds = undistorted_bounds(s->camera);
  return s;
}

FeatureSet random_set(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(-20, 660), v(-20, 500);  // some outside the bounds
  std::vector<KeyPoint> keypoints(count);
  for (KeyPoint& p : keypoints) {
    p.u = u(random);
    p.v = v(random);
    p.octave = random() % 8;
  }
  return {sensor(), keypoints, std::vector<Descriptor>(count)};
}

TEST(FeatureSet, SelectKeepsWhatIsChosenInOrder) {
  const FeatureSet set = random_set(100, 3);
  std::vector<std::uint8_t> keep(100);
  for (int i = 0; i < 100; ++i) keep[i] = set.keypoint(i).octave < 4;
  const auto fine = select(set, keep);
  ASSERT_EQ(fine->size(), std::count(keep.begin(), keep.end(), 1));
  ASSERT_GT(fine->size(), 20);
  int k = 0;
  for (int i = 0; i < 100; ++i) {
    if (!keep[i]) continue;
    EXPECT_EQ(fine->keypoint(k).u, set.keypoint(i).u);
    EXPECT_LT(fine->keypoint(k++).octave, 4);
  }
  keep.assign(100, 0);
  EXPECT_EQ(select(set, keep)->size(), 0);
  keep.pop_back();
  EXPECT_THROW(select(set, keep), Error);
}

TEST(FeatureSet, WindowSearchFindsWhatBruteForceFinds) {
  const FeatureSet set = random_set(1000, 1);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> u(-100, 740), v(-100, 580), radius(0, 120);
  std::vector<int> found{1, 2, 3};
  std::size_t total = 0;
  for (int round = 0; round < 2000; ++round) {
    const float cu = u(random), cv = v(random), r = radius(random);
    const int low = static_cast<int>(random() % 9) - 1, high = low + static_cast<int>(random() % 4);
    set.in_window(cu, cv, r, low, high, found);
    std::vector<int> expected;
    for (int i = 0; i < set.size(); ++i) {
      const KeyPoint& p = set.keypoint(i);
      if (std::abs(p.u - cu) < r && std::abs(p.v - cv) < r && p.octave >= low && p.octave <= high)
        expected.push_back(i);
    }
    std::sort(found.begin(), found.end());
    ASSERT_EQ(found, expected);
    total += found.size();
  }
  EXPECT_GT(total, 10000u);
}

TEST(FeatureSet, TheWindowIsOpen) {
  KeyPoint p;
  p.u = 100, p.v = 100;
  const FeatureSet set(sensor(), {p}, {Descriptor{}});
  std::vector<int> found;
  set.in_window(110, 100, 10, 0, 7, found);
  EXPECT_TRUE(found.empty());
  set.in_window(109.9f, 90.1f, 10, 0, 7, found);
  EXPECT_EQ(found, std::vector<int>{0});
  set.in_window(100, 100, 10, 1, 7, found);
  EXPECT_TRUE(found.empty());
  for (const float bad : {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()}) {
    set.in_window(100, 100, bad, 0, 7, found);
    EXPECT_TRUE(found.empty());
  }
}

TEST(FeatureSet, RefusesWhatDoesNotFit) {
  KeyPoint p;
  EXPECT_THROW(FeatureSet(nullptr, {}, {}), Error);
  EXPECT_THROW(FeatureSet(sensor(), {p}, {}), Error);
  EXPECT_THROW(FeatureSet(std::make_shared<Sensor>(), {}, {}), Error);
  p.octave = 8;
  EXPECT_THROW(FeatureSet(sensor(), {p}, {Descriptor{}}), Error);
  p.octave = 0;
  p.u = std::numeric_limits<float>::infinity();
  EXPECT_THROW(FeatureSet(sensor(), {p}, {Descriptor{}}), Error);
  EXPECT_THROW(FeatureSet(sensor(), std::vector<KeyPoint>(70000), std::vector<Descriptor>(70000)),
               Error);
  EXPECT_EQ(FeatureSet(sensor(), {}, {}).size(), 0);
}

class RgbdFeatures : public ::testing::Test {
 protected:
  RgbdFeatures() : gray_(testing::textured_image(640, 480, 3)), depth_(480, 640, CV_16U) {
    // Each pixel has a different depth, and every fifth has none.
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x)
        depth_.at<std::uint16_t>(y, x) =
            (x + y) % 5 == 0 ? 0 : static_cast<std::uint16_t>(5000 + 40 * x + y);
  }
  DepthView depth_view() const {
    return {depth_.ptr<std::uint16_t>(), depth_.cols, depth_.rows,
            static_cast<std::ptrdiff_t>(depth_.step / 2)};
  }
  OrbExtractor extractor_{OrbOptions{}};
  cv::Mat gray_, depth_;
};

TEST_F(RgbdFeatures, LooksDepthUpAtTheRawPixelAndUndistorts) {
  const auto distorted = sensor({0.26, -0.95, -0.005, 0.0026, 1.16});
  const auto set =
      make_rgbd_features(extractor_, distorted, testing::view(gray_), depth_view(), 1.0 / 5000);
  std::vector<RawKeyPoint> raw;
  std::vector<Descriptor> descriptors;
  extractor_.extract(testing::view(gray_), raw, descriptors);
  ASSERT_EQ(set->size(), static_cast<int>(raw.size()));
  int with_depth = 0, moved = 0;
  for (int i = 0; i < set->size(); ++i) {
    const KeyPoint& p = set->keypoint(i);
    const auto ideal = distorted->camera.undistort(raw[i].x, raw[i].y);
    EXPECT_NEAR(p.u, ideal.x(), 1e-4);
    EXPECT_NEAR(p.v, ideal.y(), 1e-4);
    moved += std::hypot(p.u - raw[i].x, p.v - raw[i].y) > 1;
    const int steps = depth_.at<std::uint16_t>(static_cast<int>(std::lround(raw[i].y)),
                                               static_cast<int>(std::lround(raw[i].x)));
    EXPECT_EQ(p.has_depth(), steps > 0);
    if (steps > 0) {
      ++with_depth;
      EXPECT_NEAR(p.depth_m, steps / 5000.0, 1e-5);
      EXPECT_NEAR(p.right_u, p.u - 40 / p.depth_m, 1e-3);
    } else {
      EXPECT_EQ(p.depth_m, -1);
      EXPECT_EQ(p.right_u, -1);
    }
    EXPECT_EQ(p.octave, raw[i].octave);
    EXPECT_EQ(p.angle_deg, raw[i].angle_deg);
    EXPECT_EQ(set->descriptor(i), descriptors[i]);
  }
  EXPECT_GT(with_depth, 700);
  EXPECT_GT(moved, 300);
}

TEST_F(RgbdFeatures, RefusesImagesOfAnotherSizeThanTheCamera) {
  const auto gray = testing::view(gray_);
  const cv::Mat small = testing::textured_image(320, 240, 1);
  DepthView short_depth = depth_view();
  short_depth.height = 479;
  EXPECT_THROW(make_rgbd_features(extractor_, sensor(), testing::view(small), depth_view(), 1e-3),
               Error);
  EXPECT_THROW(make_rgbd_features(extractor_, sensor(), gray, short_depth, 1e-3), Error);
  EXPECT_THROW(make_rgbd_features(extractor_, sensor(), gray, depth_view(), 0), Error);
  EXPECT_THROW(make_rgbd_features(extractor_, nullptr, gray, depth_view(), 1e-3), Error);
}

TEST_F(RgbdFeatures, ABlackImageGivesAnEmptySet) {
  const cv::Mat black(480, 640, CV_8U, cv::Scalar(0));
  const auto set =
      make_rgbd_features(extractor_, sensor(), testing::view(black), depth_view(), 1e-3);
  EXPECT_EQ(set->size(), 0);
  std::vector<int> found;
  set->in_window(320, 240, 1000, 0, 7, found);
  EXPECT_TRUE(found.empty());
}

}  // namespace
}  // namespace slambed
