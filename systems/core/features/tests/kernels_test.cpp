// SPDX-License-Identifier: Apache-2.0
#include "features/kernels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "features/keypoint.hpp"
#include "features/orb_pattern.hpp"
#include "features/orientation.hpp"
#include "test_images.hpp"

namespace slambed {
namespace {

const Kernels* const kAll[] = {&portable_kernels(), &fastest_kernels()};

TEST(Kernels, BlurIsTheGaussianOfOpenCvWithinRounding) {
  const cv::Mat image = testing::noise_image(131, 41, 3);
  const PaddedPlane plane = testing::padded(image);
  cv::Mat expected;
  cv::GaussianBlur(image, expected, {7, 7}, 2, 2, cv::BORDER_REFLECT_101);
  for (const Kernels* kernels : kAll) {
    constexpr int kWide = 131 + kKernelSlack;
    std::vector<std::uint8_t> scratch(kBlurScratchRows * (2 * kBlurRadius + kWide));
    std::vector<std::uint8_t> found(static_cast<std::size_t>(kWide) * image.rows);
    double bias = 0;
    const GrayView view = plane.view();
    kernels->blur(view.data, view.stride, image.cols, image.rows, scratch.data(), found.data(),
                  kWide);
    for (int y = 0; y < image.rows; ++y)
      for (int x = 0; x < image.cols; ++x) {
        const int value = found[static_cast<std::size_t>(y) * kWide + x];
        ASSERT_NEAR(value, expected.at<std::uint8_t>(y, x), 3) << kernels->name;
        bias += value - expected.at<std::uint8_t>(y, x);
      }
    EXPECT_LT(std::abs(bias / image.total()), 0.5);
  }
}

TEST(Kernels, MomentsSumUpTheDisc) {
  const cv::Mat noise = testing::noise_image(60, 50, 4);
  cv::Mat bright = noise.clone();
  bright.rowRange(26, 50) = cv::Scalar(255);  // gives the largest possible sums
  bright.rowRange(0, 25) = cv::Scalar(0);
  for (const cv::Mat& image : {noise, bright}) {
    const PaddedPlane plane = testing::padded(image);
    const int half_width[16] = {15, 15, 15, 15, 14, 14, 14, 13, 13, 12, 11, 10, 9, 8, 6, 3};
    for (const cv::Point at : {cv::Point(20, 25), cv::Point(16, 16), cv::Point(43, 33)}) {
      int m10 = 0, m01 = 0;
      for (int y = -15; y <= 15; ++y)
        for (int x = -half_width[std::abs(y)]; x <= half_width[std::abs(y)]; ++x) {
          m10 += x * image.at<std::uint8_t>(at.y + y, at.x + x);
          m01 += y * image.at<std::uint8_t>(at.y + y, at.x + x);
        }
      for (const Kernels* kernels : kAll) {
        const GrayView view = plane.view();
        const Moments found = kernels->moments(&view.at(at.x, at.y), view.stride);
        EXPECT_EQ(found.m10, m10) << kernels->name;
        EXPECT_EQ(found.m01, m01) << kernels->name;
      }
    }
  }
}

TEST(Orientation, MatchesTheArcTangentAllAround) {
  for (int degree = 0; degree < 360; ++degree) {
    const double radians = degree * std::numbers::pi / 180;
    const Moments m{static_cast<int>(std::lround(1e6 * std::cos(radians))),
                    static_cast<int>(std::lround(1e6 * std::sin(radians)))};
    const Orientation o = orientation_of(m);
    EXPECT_NEAR(o.angle_deg, degree, 1e-3);
    EXPECT_NEAR(o.cosine, std::cos(radians), 2e-6);
    EXPECT_NEAR(o.sine, std::sin(radians), 2e-6);
  }
  const Orientation nowhere = orientation_of({0, 0});
  EXPECT_EQ(nowhere.angle_deg, 0);
  EXPECT_EQ(nowhere.cosine, 1);
  EXPECT_LT(orientation_of({1000000, -1}).angle_deg, 360.0f);
}

TEST(Kernels, DescribeRotatesThePatternAndCompares) {
  const cv::Mat image = testing::noise_image(60, 60, 6);
  const PaddedPlane plane = testing::padded(image);
  PatternPoints pattern;
  for (int i = 0; i < 256; ++i) {
    pattern.x[2 * i] = kOrbPattern[i].ax, pattern.y[2 * i] = kOrbPattern[i].ay;
    pattern.x[2 * i + 1] = kOrbPattern[i].bx, pattern.y[2 * i + 1] = kOrbPattern[i].by;
  }
  int reach = 0;
  for (int degree = 0; degree < 360; degree += 7) {
    const float c = static_cast<float>(std::cos(degree * std::numbers::pi / 180));
    const float s = static_cast<float>(std::sin(degree * std::numbers::pi / 180));
    Descriptor expected{};
    for (int i = 0; i < 256; ++i) {
      const auto pixel = [&](float x, float y) {
        const int column = static_cast<int>(std::nearbyint(x * c - y * s));
        const int row = static_cast<int>(std::nearbyint(x * s + y * c));
        reach = std::max({reach, std::abs(column), std::abs(row)});
        return image.at<std::uint8_t>(30 + row, 30 + column);
      };
      const std::uint64_t darker =
          pixel(kOrbPattern[i].ax, kOrbPattern[i].ay) < pixel(kOrbPattern[i].bx, kOrbPattern[i].by);
      expected[i / 64] |= darker << (i % 64);
    }
    for (const Kernels* kernels : kAll) {
      Descriptor found{};
      const GrayView view = plane.view();
      kernels->describe(&view.at(30, 30), view.stride, pattern, c, s, found.data());
      EXPECT_EQ(found, expected) << kernels->name << " at " << degree;
    }
  }
  EXPECT_LE(reach, kPatternReach);
}

TEST(Kernels, SlidingPatchesAddsUpWhatOneReadsInTheImages) {
  const cv::Mat noise = testing::noise_image(80, 30, 7);
  cv::Mat contrast = noise.clone(), shifted;
  contrast = contrast > 128;  // gives the largest possible sums
  for (const cv::Mat& left : {noise, contrast})
    for (const int shift : {0, 3, -4, 5, -5, 9}) {
      cv::copyMakeBorder(left, shifted, 0, 0, 12, 12, cv::BORDER_WRAP);
      const cv::Mat right = shifted(cv::Rect(12 - shift, 0, 80, 30)) / 2 + 60;
      const PaddedPlane left_plane = testing::padded(left), right_plane = testing::padded(right);
      const int x = 40, y = 14;
      int best = 0, least = 0;
      int totals[11] = {}, squares[11] = {};
      for (int place = 0; place < 11; ++place) {
        int absolute = 0;
        const auto seen = [&](const cv::Mat& image, int column, int dx, int dy) {
          return image.at<std::uint8_t>(y + dy, column + dx) - image.at<std::uint8_t>(y, column);
        };
        for (int dy = -5; dy <= 5; ++dy)
          for (int dx = -5; dx <= 5; ++dx) {
            const int difference = seen(left, x, dx, dy) - seen(right, x + place - 5, dx, dy);
            absolute += std::abs(difference);
            totals[place] += difference;
            squares[place] += difference * difference;
          }
        if (place == 0 || absolute < least) least = absolute, best = place;
      }
      for (const Kernels* kernels : kAll) {
        const GrayView l = left_plane.view(), r = right_plane.view();
        const PatchSlide found = kernels->slide_patch(&l.at(x, y), l.stride, &r.at(x, y), r.stride);
        EXPECT_EQ(found.best, best) << kernels->name << " " << shift;
        EXPECT_EQ(found.absolute, least);
        for (int i = 0; i < 3 && best > 0 && best < 10; ++i) {
          EXPECT_EQ(found.total[i], totals[best + i - 1]) << kernels->name;
          EXPECT_EQ(found.squares[i], squares[best + i - 1]) << kernels->name;
        }
      }
    }
}

}  // namespace
}  // namespace slambed
