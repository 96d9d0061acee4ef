// SPDX-License-Identifier: Apache-2.0
#include "synth/sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "features/orb_extractor.hpp"
#include "synth/generator.hpp"

namespace slambed::synth {
namespace {

std::shared_ptr<const Scene> coarse_room() {
  static const auto scene = make_room({.texel_scale = 3, .threads = 2}, {});
  return scene;
}

Shot shoot(const SensorOptions& options, double time_s = 23.5, const char* path = "office") {
  SensorModel sensor(coarse_room(), generator_camera({}), options);
  return sensor.capture_rgbd(*make_path(path, 0, 1), 7, time_s);
}

double sharpness(const std::vector<std::uint8_t>& gray) {
  double sum = 0;
  for (std::size_t i = 1; i < gray.size(); ++i) sum += std::abs(gray[i] - gray[i - 1]);
  return sum / static_cast<double>(gray.size());
}

double lost(const std::vector<std::uint16_t>& depth) {
  double none = 0;
  for (const auto z : depth) none += z == 0;
  return none / static_cast<double>(depth.size());
}

TEST(Sensor, OrbFindsAThousandFeaturesEverywhere) {
  // Uses the system's own extractor at full texture resolution.
  const auto scene = make_room({.texel_scale = 1, .threads = 2}, {});
  const auto path = make_path("spline", 60, 5);
  SensorModel sensor(scene, generator_camera({}), {.noise = 2});
  OrbExtractor extractor{OrbOptions{}};
  std::vector<RawKeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
  for (double t = 0; t < 60; t += 12) {
    const Shot shot = sensor.capture_rgbd(*path, static_cast<int>(t), t);
    extractor.extract({shot.gray.data(), 640, 480, 640}, keypoints, descriptors);
    EXPECT_GT(keypoints.size(), 900u) << "at " << t;
    std::set<int> cells;
    for (const RawKeyPoint& k : keypoints)
      cells.insert(static_cast<int>(k.y / 60) * 8 + static_cast<int>(k.x / 80));
    EXPECT_GT(cells.size(), 50u) << "of 64 cells at " << t;
  }
}

TEST(Sensor, ExposureBlursTheFastTurnOnly) {
  const double still = sharpness(shoot({}, 0.5, "still").gray);
  EXPECT_NEAR(sharpness(shoot({.motion_blur_s = 0.02}, 0.5, "still").gray), still, 0.02 * still);
  EXPECT_LT(sharpness(shoot({.motion_blur_s = 0.02}).gray), 0.8 * sharpness(shoot({}).gray));
}

TEST(Sensor, NoiseHasTheAskedDeviation) {
  const Shot clean = shoot({}), noisy = shoot({.noise = 4, .depth_noise = 1});
  double gray2 = 0, scaled2 = 0, n = 0;
  for (std::size_t i = 0; i < clean.gray.size(); ++i) {
    const double d = noisy.gray[i] - clean.gray[i];
    gray2 += d * d;
    const double z = clean.depth[i] * 0.0002, error = (noisy.depth[i] - clean.depth[i]) * 0.0002;
    const double sigma = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);
    scaled2 += error * error / (sigma * sigma);
    n += 1;
  }
  EXPECT_NEAR(std::sqrt(gray2 / n), 4, 0.2);
  EXPECT_NEAR(std::sqrt(scaled2 / n), 1, 0.03);
}

TEST(Sensor, HolesLoseAboutTheAskedShareAndAllEdges) {
  EXPECT_LT(lost(shoot({}).depth), 0.001);
  const double edges = lost(shoot({.depth_holes = 1e-9}).depth);
  EXPECT_GT(edges, 0.002);
  EXPECT_NEAR(lost(shoot({.depth_holes = 0.2}).depth) - edges, 0.2, 0.05);
}

TEST(Sensor, BlackoutLeavesNeitherTextureNorDepth) {
  const SensorOptions covered{.noise = 1, .blackout_start_s = 23, .blackout_end_s = 24};
  const Shot dark = shoot(covered);
  EXPECT_EQ(lost(dark.depth), 1);
  for (const auto g : dark.gray) ASSERT_LT(g, 12);
  EXPECT_GT(sharpness(shoot(covered, 24.0).gray), 1);
}

TEST(Sensor, RightPictureIsTheLeftOneMovedByDisparity) {
  GeneratorOptions generator;
  generator.sensor = "stereo";
  const Camera camera = generator_camera(generator);
  SensorOptions options;
  options.baseline_m = camera.baseline_m();
  const auto path = make_path("office", 0, 1);
  SensorModel sensor(coarse_room(), camera, options);
  const Shot pair = sensor.capture_stereo(*path, 0, 5);
  const Shot truth = sensor.capture_rgbd(*path, 0, 5);
  ASSERT_EQ(pair.gray, truth.gray);
  double matched = 0, unmoved = 0, n = 0;
  for (int y = 0; y < 480; y += 2) {
    for (int x = 160; x < 640; x += 2) {
      const double z = truth.depth[y * 640 + x] * options.depth_unit_m;
      const int right = static_cast<int>(std::lround(x - camera.bf / z));
      if (z < 0.5) continue;
      matched += std::abs(pair.right[y * 640 + right] - pair.gray[y * 640 + x]);
      unmoved += std::abs(pair.right[y * 640 + x] - pair.gray[y * 640 + x]);
      n += 1;
    }
  }
  ASSERT_GT(n, 30000);
  EXPECT_LT(matched, 0.5 * unmoved);
}

}  // namespace
}  // namespace slambed::synth
