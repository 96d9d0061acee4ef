// SPDX-License-Identifier: Apache-2.0
#include "features/orb_extractor.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <random>
#include <tuple>

#include "base/error.hpp"
#include "features/kernels.hpp"
#include "features/pyramid.hpp"
#include "test_images.hpp"

namespace {
std::atomic<long> allocations{0};
}

// Counts all allocations of the program, so that a test can check for none. Not inlined, because
// gcc would then warn of mismatched new and delete.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size ? size : 1)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace slambed {
namespace {

using testing::textured_image;
using testing::view;

struct Features {
  std::vector<RawKeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
};

Features extract(OrbExtractor& extractor, const cv::Mat& image) {
  Features f;
  extractor.extract(view(image), f.keypoints, f.descriptors);
  return f;
}

void expect_same(const Features& a, const Features& b) {
  ASSERT_EQ(a.keypoints.size(), b.keypoints.size());
  EXPECT_EQ(a.descriptors, b.descriptors);
  for (std::size_t i = 0; i < a.keypoints.size(); ++i) {
    const RawKeyPoint &p = a.keypoints[i], &q = b.keypoints[i];
    ASSERT_EQ(std::tuple(p.x, p.y, p.angle_deg, p.octave, p.response),
              std::tuple(q.x, q.y, q.angle_deg, q.octave, q.response));
  }
}

TEST(OrbExtractor, FillsTheQuotaOfEveryLevelWithPointsInsideTheImage) {
  OrbExtractor extractor({});
  const Features f = extract(extractor, textured_image(640, 480, 1));
  ASSERT_EQ(f.keypoints.size(), f.descriptors.size());
  std::vector<int> found(8, 0);
  int octave = 0;
  for (const RawKeyPoint& p : f.keypoints) {
    EXPECT_GE(p.octave, octave) << "level 0 comes first";
    octave = p.octave;
    ++found[p.octave];
    EXPECT_TRUE(p.x >= 15 && p.x < 625 && p.y >= 15 && p.y < 465);
    EXPECT_TRUE(p.angle_deg >= 0 && p.angle_deg < 360);
    EXPECT_GE(p.response, 7);
  }
  EXPECT_EQ(found, extractor.quotas());
}

TEST(OrbExtractor, SameImageSameBytesWhateverTheKernelsAndTheHistory) {
  for (const auto distribution : {Distribution::kGrid, Distribution::kQuadtree}) {
    const OrbOptions options{.distribution = distribution};
    OrbExtractor fast(options), portable(options, portable_kernels()), used(options);
    extract(used, textured_image(333, 222, 9));
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const cv::Mat image = textured_image(601, 399, seed);
      const Features f = extract(fast, image);
      EXPECT_GT(f.keypoints.size(), 900u);
      expect_same(f, extract(portable, image));
      expect_same(f, extract(used, image));
    }
  }
}

TEST(OrbExtractor, EveryMachineFindsTheseBytes) {
  // Measured on x86-64 with and without AVX2 and on arm64. If a deliberate change of the algorithm
  // alters it, earlier results and cached features are no longer comparable with new ones.
  std::mt19937 random(1);
  cv::Mat image(300, 400, CV_8U, cv::Scalar(128));
  for (int box = 0; box < 500; ++box) {
    const int x0 = random() % 400, y0 = random() % 300;
    const int x1 = std::min<int>(400, x0 + 4 + random() % 40);
    const int y1 = std::min<int>(300, y0 + 4 + random() % 40);
    const int gray = 10 + random() % 230;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x)
        image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(gray + random() % 5);
  }
  OrbExtractor extractor({});
  const Features f = extract(extractor, image);
  std::uint64_t hash = 1469598103934665603u;  // FNV-1a
  const auto add = [&](std::uint64_t value) { hash = (hash ^ value) * 1099511628211u; };
  for (std::size_t i = 0; i < f.keypoints.size(); ++i) {
    const RawKeyPoint& p = f.keypoints[i];
    for (const float value : {p.x, p.y, p.angle_deg}) add(std::bit_cast<std::uint32_t>(value));
    add(p.octave);
    for (const std::uint64_t word : f.descriptors[i]) add(word);
  }
  EXPECT_EQ(f.keypoints.size(), 1000u);
  EXPECT_EQ(hash, 7593996884554927863u);
}

TEST(OrbExtractor, ReadsThroughTheStride) {
  const cv::Mat wide = textured_image(700, 400, 2);
  const cv::Mat part = wide(cv::Rect(50, 20, 500, 350));
  OrbExtractor extractor({});
  const Features strided = extract(extractor, part);
  expect_same(strided, extract(extractor, part.clone()));
}

TEST(OrbExtractor, TheSecondImageAllocatesNothing) {
  const cv::Mat flat(480, 640, CV_8U, cv::Scalar(9)), rich = testing::noise_image(640, 480, 1);
  const cv::Mat usual = textured_image(640, 480, 1);
  for (const auto distribution : {Distribution::kGrid, Distribution::kQuadtree}) {
    OrbExtractor extractor({.distribution = distribution});
    Features f;
    extractor.extract(view(flat), f.keypoints, f.descriptors);
    const long before = allocations;
    extractor.extract(view(rich), f.keypoints, f.descriptors);
    extractor.extract(view(usual), f.keypoints, f.descriptors);
    EXPECT_EQ(allocations - before, 0);
    EXPECT_GT(f.keypoints.size(), 900u);
  }
}

TEST(OrbExtractor, ImagesWithoutTextureHaveNoFeatures) {
  OrbExtractor extractor({});
  for (const int gray : {0, 1, 128, 255}) {
    const Features f = extract(extractor, cv::Mat(480, 640, CV_8U, cv::Scalar(gray)));
    EXPECT_TRUE(f.keypoints.empty());
    EXPECT_TRUE(f.descriptors.empty());
  }
}

TEST(OrbExtractor, TinyAndOddImagesAreNoProblem) {
  OrbExtractor extractor({});
  for (int side = 1; side < 80; ++side) {
    const Features f = extract(extractor, testing::noise_image(side, side + side % 7, side));
    EXPECT_TRUE(side >= ImagePyramid::kMinSide || f.keypoints.empty()) << side;
    EXPECT_TRUE(side <= 50 || !f.keypoints.empty()) << side;
  }
  EXPECT_TRUE(extract(extractor, testing::noise_image(5000, 10, 1)).keypoints.empty());
  EXPECT_FALSE(extract(extractor, testing::noise_image(2000, 40, 1)).keypoints.empty());
  Features f{{RawKeyPoint{}}, {Descriptor{}}};
  extractor.extract(GrayView{}, f.keypoints, f.descriptors);
  EXPECT_TRUE(f.keypoints.empty());
  EXPECT_TRUE(f.descriptors.empty());
}

TEST(OrbExtractor, RefusesHugeImages) {
  OrbExtractor extractor({});
  Features f;
  const std::uint8_t pixel = 0;
  EXPECT_THROW(extractor.extract({&pixel, 20000, 40, 20000}, f.keypoints, f.descriptors), Error);
}

TEST(OrbExtractor, DescriptorsAreThoseOfOpenCv) {
  // Pattern, bit order and sense of rotation are the same, so published vocabularies can be used.
  // The blurs round differently, which flips the bits of nearly equal pixels.
  const cv::Mat image = textured_image(640, 480, 5);
  OrbExtractor extractor({.features = 400, .levels = 1, .subpixel = false});
  const Features f = extract(extractor, image);
  std::vector<cv::KeyPoint> keypoints;
  for (std::size_t i = 0; i < f.keypoints.size(); ++i) {
    const RawKeyPoint& p = f.keypoints[i];
    keypoints.emplace_back(p.x, p.y, 31.0f, p.angle_deg, p.response, 0, static_cast<int>(i));
  }
  cv::Mat descriptors;
  cv::ORB::create(1000, 1.2f, 1, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31)
      ->compute(image, keypoints, descriptors);
  ASSERT_GT(keypoints.size(), 300u);
  double bits = 0;
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    Descriptor theirs;
    std::memcpy(theirs.data(), descriptors.ptr(static_cast<int>(k)), sizeof theirs);
    bits += hamming(theirs, f.descriptors[keypoints[k].class_id]);
  }
  EXPECT_LT(bits / keypoints.size(), 8) << "of 256 bits";
}

struct Warp {
  double degrees, scale;
};

/// Returns the share of features that are matched correctly after a warp, among those still well
/// inside the image: the best Hamming match is at the right position and below the limit.
double found_again(const cv::Mat& image, const Warp& warp, double* mean_turn_error_deg = nullptr) {
  const cv::Mat to_warped =
      cv::getRotationMatrix2D({image.cols / 2.0f, image.rows / 2.0f}, warp.degrees, warp.scale);
  cv::Mat warped;
  cv::warpAffine(image, warped, to_warped, image.size(),
                 warp.scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR, cv::BORDER_REFLECT_101);
  OrbExtractor extractor({});
  const Features a = extract(extractor, image), b = extract(extractor, warped);
  const ScalePyramid pyramid;
  int inside = 0, right = 0;
  double turn_error = 0;
  for (std::size_t i = 0; i < a.keypoints.size(); ++i) {
    const RawKeyPoint& p = a.keypoints[i];
    const cv::Mat q = to_warped * (cv::Mat_<double>(3, 1) << p.x, p.y, 1.0);
    const double x = q.at<double>(0), y = q.at<double>(1);
    if (x < 60 || y < 60 || x > image.cols - 60 || y > image.rows - 60) continue;
    ++inside;
    int best = kHammingLow + 1;
    std::size_t who = 0;
    for (std::size_t j = 0; j < b.keypoints.size(); ++j)
      if (const int d = hamming(a.descriptors[i], b.descriptors[j]); d < best) best = d, who = j;
    if (best > kHammingLow) continue;
    const RawKeyPoint& m = b.keypoints[who];
    if (std::hypot(m.x - x, m.y - y) > 3 * pyramid.scale[m.octave]) continue;
    ++right;
    // OpenCV rotates counter-clockwise as seen on the screen, where y points down.
    turn_error += std::abs(std::remainder(m.angle_deg - p.angle_deg + warp.degrees, 360.0));
  }
  if (mean_turn_error_deg) *mean_turn_error_deg = turn_error / std::max(1, right);
  return static_cast<double>(right) / std::max(1, inside);
}

TEST(OrbExtractor, FindsFeaturesAgainUnderRotationAndScale) {
  const cv::Mat image = textured_image(640, 480, 6);
  EXPECT_EQ(found_again(image, {0, 1}), 1.0);
  for (const Warp warp : {Warp{90, 1}, Warp{180, 1}, Warp{10, 1}, Warp{33, 1}, Warp{-140, 1},
                          Warp{0, 1.2}, Warp{0, 0.8}, Warp{20, 1.1}}) {
    double turn_error = 0;
    EXPECT_GT(found_again(image, warp, &turn_error), 0.4) << warp.degrees << ", " << warp.scale;
    EXPECT_LT(turn_error, 6) << warp.degrees << ", " << warp.scale;
  }
}

}  // namespace
}  // namespace slambed
