// SPDX-License-Identifier: Apache-2.0
// Times the extraction stages on a synthetic 640x480 image, over all eight levels, with the fastest
// and the portable kernels: features_bench --benchmark_filter=.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <random>

#include "features/corner_detector.hpp"
#include "features/corner_selector.hpp"
#include "features/feature_set.hpp"
#include "features/kernels.hpp"
#include "features/orb_extractor.hpp"
#include "features/orientation.hpp"
#include "features/pyramid.hpp"
#include "features/stereo_matcher.hpp"

namespace slambed {
namespace {

constexpr int kWidth = 640, kHeight = 480;

/// Boxes of random size and gray level with slight noise: about 7,000 corners over the pyramid, as
/// in a cluttered room.
const std::vector<std::uint8_t>& scene() {
  static const std::vector<std::uint8_t> pixels = [] {
    std::mt19937 random(1);
    const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
    std::vector<std::uint8_t> image(static_cast<std::size_t>(kWidth) * kHeight, 128);
    for (int box = 0; box < 900; ++box) {
      const int x0 = below(kWidth), y0 = below(kHeight);
      const int x1 = std::min(kWidth, x0 + 4 + below(50)),
                y1 = std::min(kHeight, y0 + 4 + below(50));
      const auto gray = static_cast<std::uint8_t>(20 + below(200));
      for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
          image[static_cast<std::size_t>(y) * kWidth + x] =
              static_cast<std::uint8_t>(gray + below(7));
    }
    return image;
  }();
  return pixels;
}

GrayView view() { return {scene().data(), kWidth, kHeight, kWidth}; }
const Kernels& kernels(const benchmark::State& state) {
  return state.range(0) ? fastest_kernels() : portable_kernels();
}

void Pyramid(benchmark::State& state) {
  ImagePyramid pyramid(ScalePyramid().scale, kernels(state));
  for (auto _ : state) pyramid.build(view());
  state.SetLabel(kernels(state).name);
}

void Detection(benchmark::State& state) {
  ImagePyramid pyramid(ScalePyramid().scale, kernels(state));
  pyramid.build(view());
  CornerDetector detector(20, 7, kernels(state));
  std::vector<Corner> corners;
  std::size_t found = 0;
  for (auto _ : state) {
    found = 0;
    for (int i = 0; i < pyramid.levels(); ++i) {
      detector.detect(pyramid.level(i), corners);
      found += corners.size();
    }
  }
  state.counters["corners"] = static_cast<double>(found);
}

void Selection(benchmark::State& state) {
  const OrbOptions options{.distribution =
                               state.range(0) ? Distribution::kGrid : Distribution::kQuadtree};
  ImagePyramid pyramid(ScalePyramid().scale, fastest_kernels());
  pyramid.build(view());
  CornerDetector detector(20, 7, fastest_kernels());
  CornerSelector selector(options.distribution);
  const std::vector<int> quotas = OrbExtractor(options).quotas();
  std::vector<std::vector<Corner>> found(pyramid.levels());
  for (int i = 0; i < pyramid.levels(); ++i) detector.detect(pyramid.level(i), found[i]);
  std::vector<Corner> corners;
  for (auto _ : state)
    for (int i = 0; i < pyramid.levels(); ++i) {
      corners = found[i];
      selector.select(DetectionRegion(pyramid.level(i)), quotas[i], corners);
    }
  state.SetLabel(state.range(0) ? "grid" : "quadtree");
}

void Blur(benchmark::State& state) {
  ImagePyramid pyramid(ScalePyramid().scale, kernels(state));
  pyramid.build(view());
  constexpr int kWide = kWidth + kKernelSlack;
  std::vector<std::uint8_t> scratch(kBlurScratchRows * (2 * kBlurRadius + kWide));
  std::vector<std::uint8_t> blurred(kWide * kHeight);
  for (auto _ : state)
    for (int i = 0; i < pyramid.levels(); ++i) {
      const GrayView level = pyramid.level(i);
      kernels(state).blur(level.data, level.stride, level.width, level.height, scratch.data(),
                          blurred.data(), kWide);
      benchmark::DoNotOptimize(blurred.data());
    }
}

/// Orientation of 1,000 points.
void Orient(benchmark::State& state) {
  for (auto _ : state)
    for (int i = 0; i < 1000; ++i) {
      const int x = 20 + i * 31 % 600, y = 20 + i * 17 % 440;
      benchmark::DoNotOptimize(
          orientation_of(kernels(state).moments(&view().at(x, y), view().stride)));
    }
}

/// Descriptors of 1,000 points.
void Describe(benchmark::State& state) {
  PatternPoints pattern;
  std::mt19937 random(2);
  for (int i = 0; i < 512; ++i) {
    pattern.x[i] = static_cast<float>(random() % 25) - 12;
    pattern.y[i] = static_cast<float>(random() % 25) - 12;
  }
  Descriptor descriptor;
  for (auto _ : state)
    for (int i = 0; i < 1000; ++i) {
      const int x = 20 + i * 31 % 600, y = 20 + i * 17 % 440;
      const float sine = static_cast<float>(i % 100) / 100, cosine = 1 - sine * sine / 2;
      kernels(state).describe(&view().at(x, y), view().stride, pattern, cosine, sine,
                              descriptor.data());
      benchmark::DoNotOptimize(descriptor);
    }
}

void Extraction(benchmark::State& state) {
  OrbExtractor extractor({}, kernels(state));
  std::vector<RawKeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
  for (auto _ : state) extractor.extract(view(), keypoints, descriptors);
  state.counters["features"] = static_cast<double>(keypoints.size());
}

std::shared_ptr<const Sensor> sensor() {
  auto s = std::make_shared<Sensor>();
  s->camera = {.width = kWidth,
               .height = kHeight,
               .fx = 517,
               .fy = 516,
               .cx = 318,
               .cy = 255,
               .bf = 40,
               .distortion = {0.26, -0.95, -0.005, 0.0026, 1.16}};
  s->bounds = undistorted_bounds(s->camera);
  return s;
}

void RgbdFrame(benchmark::State& state) {
  OrbExtractor extractor{OrbOptions{}};
  const auto shared = sensor();
  const std::vector<std::uint16_t> depth(scene().size(), 9000);
  for (auto _ : state)
    benchmark::DoNotOptimize(make_rgbd_features(
        extractor, shared, view(), {depth.data(), kWidth, kHeight, kWidth}, 1.0 / 5000));
}

/// Matching without extraction, for a pair with 20 px disparity.
void Stereo(benchmark::State& state) {
  OrbExtractor left{OrbOptions{}}, right{OrbOptions{}};
  auto rectified = std::make_shared<Sensor>(*sensor());
  rectified->camera.distortion = {};
  std::vector<std::uint8_t> shifted(scene().size(), 128);
  for (std::size_t i = 0; i + 20 < shifted.size(); ++i) shifted[i] = scene()[i + 20];
  std::vector<RawKeyPoint> left_points, right_points;
  std::vector<Descriptor> left_descriptors, right_descriptors;
  left.extract(view(), left_points, left_descriptors);
  right.extract({shifted.data(), kWidth, kHeight, kWidth}, right_points, right_descriptors);
  StereoMatcher matcher(rectified);
  std::vector<float> disparity;
  for (auto _ : state)
    matcher.match({left_points, left_descriptors, left.pyramid()},
                  {right_points, right_descriptors, right.pyramid()}, disparity);
  state.counters["matched"] = static_cast<double>(
      std::count_if(disparity.begin(), disparity.end(), [](float d) { return d > 0; }));
}

/// 1,000 searches in windows of 15 px radius.
void WindowSearch(benchmark::State& state) {
  OrbExtractor extractor{OrbOptions{}};
  const std::vector<std::uint16_t> depth(scene().size(), 9000);
  const auto set = make_rgbd_features(extractor, sensor(), view(),
                                      {depth.data(), kWidth, kHeight, kWidth}, 1.0 / 5000);
  std::vector<int> found;
  for (auto _ : state)
    for (int i = 0; i < 1000; ++i) {
      set->in_window(static_cast<float>(i * 31 % 640), static_cast<float>(i * 17 % 480), 15, 0, 7,
                     found);
      benchmark::DoNotOptimize(found.data());
    }
}

#define BOTH_KERNELS(name) BENCHMARK(name)->Arg(1)->Arg(0)->Unit(benchmark::kMicrosecond)
BOTH_KERNELS(Pyramid);
BOTH_KERNELS(Detection);
BOTH_KERNELS(Selection);
BOTH_KERNELS(Blur);
BOTH_KERNELS(Orient);
BOTH_KERNELS(Describe);
BOTH_KERNELS(Extraction);
BENCHMARK(RgbdFrame)->Unit(benchmark::kMicrosecond);
BENCHMARK(Stereo)->Unit(benchmark::kMicrosecond);
BENCHMARK(WindowSearch)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace slambed
