// SPDX-License-Identifier: Apache-2.0
#include "features/pyramid.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "base/error.hpp"
#include "features/orb_extractor.hpp"
#include "test_images.hpp"

namespace slambed {
namespace {

using testing::textured_image;
using testing::to_mat;
using testing::view;

TEST(ScalePyramid, HasGeometricScalesAndVariances) {
  const ScalePyramid pyramid;
  ASSERT_EQ(pyramid.levels(), 8);
  EXPECT_FLOAT_EQ(pyramid.scale[0], 1);
  EXPECT_NEAR(pyramid.scale[7], 3.5832, 1e-3);
  EXPECT_NEAR(pyramid.sigma2[3], 1.728 * 1.728, 1e-4);
  EXPECT_NEAR(pyramid.sigma2[5] * pyramid.inv_sigma2[5], 1, 1e-6);
  EXPECT_NEAR(pyramid.log_scale_factor, 0.18232, 1e-5);
}

TEST(ScalePyramid, RefusesSenselessOptions) {
  for (const OrbOptions& bad :
       {OrbOptions{.features = 0}, OrbOptions{.levels = 0}, OrbOptions{.scale_factor = 1.0f},
        OrbOptions{.scale_factor = 2.5f}, OrbOptions{.fast_threshold = 5},
        OrbOptions{.fast_threshold_min = 0}}) {
    EXPECT_THROW(ScalePyramid{bad}, Error);
    EXPECT_THROW(OrbExtractor{bad}, Error);
  }
}

TEST(Quotas, FollowTheGeometricSeriesOfOrbSlam2) {
  EXPECT_EQ(OrbExtractor({}).quotas(), (std::vector<int>{217, 181, 151, 126, 105, 87, 73, 60}));
  for (const int features : {1, 7, 500, 2000}) {
    const auto quotas = OrbExtractor({.features = features}).quotas();
    EXPECT_EQ(std::accumulate(quotas.begin(), quotas.end(), 0), features);
  }
}

TEST(ImagePyramid, LevelsHaveTheRoundedSizes) {
  ImagePyramid pyramid(ScalePyramid().scale, fastest_kernels());
  pyramid.build(view(textured_image(640, 480, 1)));
  const std::vector<std::pair<int, int>> expected{{640, 480}, {533, 400}, {444, 333}, {370, 278},
                                                  {309, 231}, {257, 193}, {214, 161}, {179, 134}};
  ASSERT_EQ(pyramid.levels(), 8);
  for (int i = 0; i < 8; ++i)
    EXPECT_EQ(std::pair(pyramid.level(i).width, pyramid.level(i).height), expected[i]);
}

TEST(ImagePyramid, StopsBeforeLevelsThatAreTooSmall) {
  ImagePyramid pyramid(ScalePyramid().scale, fastest_kernels());
  pyramid.build(view(textured_image(60, 50, 1)));
  EXPECT_EQ(pyramid.levels(), 3);  // heights 50, 42, 35; the next would be 29 px
  pyramid.build(view(textured_image(20, 20, 1)));
  EXPECT_EQ(pyramid.levels(), 0);
  pyramid.build(view(textured_image(200, 200, 1)));
  EXPECT_EQ(pyramid.levels(), 8);
}

TEST(ImagePyramid, KeepsBrightnessAndPlaces) {
  // A ramp stays the same ramp when the center of pixel x lies at (x + 0.5) * ratio - 0.5.
  cv::Mat ramp(200, 250, CV_8U);
  for (int y = 0; y < ramp.rows; ++y)
    for (int x = 0; x < ramp.cols; ++x)
      ramp.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(0.6 * x + 0.5 * y);
  ImagePyramid pyramid(ScalePyramid().scale, fastest_kernels());
  pyramid.build(view(ramp));
  for (int i = 1; i < pyramid.levels(); ++i) {
    const GrayView level = pyramid.level(i);
    const double rx = 250.0 / level.width, ry = 200.0 / level.height;
    for (int y = 2; y < level.height - 2; ++y)
      for (int x = 2; x < level.width - 2; ++x)
        ASSERT_NEAR(level.at(x, y),
                    0.6 * ((x + 0.5) * rx - 0.5) + 0.5 * ((y + 0.5) * ry - 0.5) - 0.5, 2.5)
            << "level " << i;
  }
}

TEST(ImagePyramid, AveragesAreasAsOpenCvDoes) {
  const cv::Mat image = textured_image(322, 243, 3);
  ImagePyramid pyramid(ScalePyramid().scale, fastest_kernels());
  pyramid.build(view(image));
  for (int i = 1; i < pyramid.levels(); ++i) {
    const cv::Mat level = to_mat(pyramid.level(i)), source = to_mat(pyramid.level(i - 1));
    cv::Mat expected;
    cv::resize(source, expected, level.size(), 0, 0, cv::INTER_AREA);
    EXPECT_LE(cv::norm(level, expected, cv::NORM_INF), 2) << "level " << i;
  }
}

TEST(ImagePyramid, AllKernelsMakeTheSameBytes) {
  for (const float factor : {1.1f, 1.2f, 1.5f, 1.9f, 2.0f}) {
    const auto scale = ScalePyramid({.levels = 5, .scale_factor = factor}).scale;
    ImagePyramid fast(scale, fastest_kernels()), portable(scale, portable_kernels());
    for (const int width : {640, 641, 333, 97}) {
      const cv::Mat image = textured_image(width, 301, 9);
      fast.build(view(image));
      portable.build(view(image));
      ASSERT_EQ(fast.levels(), portable.levels());
      for (int i = 0; i < fast.levels(); ++i)
        EXPECT_EQ(cv::norm(to_mat(fast.level(i)), to_mat(portable.level(i)), cv::NORM_INF), 0)
            << "factor " << factor << " width " << width << " level " << i;
    }
  }
}

TEST(PaddedPlane, MirrorsAsReflect101) {
  const cv::Mat image = testing::noise_image(40, 35, 2);
  const PaddedPlane plane = testing::padded(image);
  constexpr int kBorder = PaddedPlane::kBorder;
  cv::Mat expected;
  cv::copyMakeBorder(image, expected, kBorder, kBorder, kBorder, kBorder, cv::BORDER_REFLECT_101);
  const GrayView inner = plane.view();
  const GrayView all{inner.row(-kBorder) - kBorder, expected.cols, expected.rows, inner.stride};
  EXPECT_EQ(cv::norm(to_mat(all), expected, cv::NORM_INF), 0);
}

}  // namespace
}  // namespace slambed
