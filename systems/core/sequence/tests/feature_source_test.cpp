// SPDX-License-Identifier: Apache-2.0
#include "sequence/feature_source.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/tests/temporary_folder.hpp"
#include "sequence/feature_cache.hpp"
#include "synth/generator.hpp"

namespace slambed {
namespace {

OrbOptions orb() {
  OrbOptions options;
  options.features = 500;
  return options;
}

std::shared_ptr<const Sensor> sensor_of(const PreparedSequence& sequence) {
  auto sensor = std::make_shared<Sensor>();
  sensor->camera = sequence.camera();
  sensor->bounds = undistorted_bounds(sensor->camera);
  sensor->pyramid = ScalePyramid(orb());
  sensor->close_depth_m = static_cast<float>(sequence.close_depth_m());
  return sensor;
}

/// The same synthetic room and camera path, for each kind of sensor.
class FeatureSourceTest : public ::testing::TestWithParam<const char*> {
 protected:
  std::filesystem::path make(const std::string& sensor) {
    synth::GeneratorOptions options;
    options.sensor = sensor;
    options.width = 320;
    options.height = 240;
    options.fps = 5;
    options.seconds = 0.6;
    const auto path = folder.path() / sensor;
    synth::generate(options, path, 1, [](int, int) { return true; });
    return path;
  }

  testing::TemporaryFolder folder;
};

TEST_P(FeatureSourceTest, TheCacheGivesTheSameFeaturesAsExtraction) {
  const PreparedSequence sequence(make(GetParam()));
  const auto sensor = sensor_of(sequence);
  ExtractingSource fresh(sequence, sensor, orb());
  FeatureCache cache(folder.path() / "x.features", "key", sequence.frames(), fresh);
  ASSERT_EQ(sequence.frames(), 3u);
  for (std::uint64_t frame = 0; frame < sequence.frames(); ++frame) {
    const auto a = fresh.features(frame), b = cache.features(frame);
    ASSERT_GT(a->size(), 300);
    ASSERT_EQ(a->size(), b->size());
    EXPECT_TRUE(std::ranges::equal(a->descriptors(), b->descriptors()));
    for (int i = 0; i < a->size(); ++i) {
      const KeyPoint &p = a->keypoint(i), &q = b->keypoint(i);
      EXPECT_TRUE(p.u == q.u && p.v == q.v && p.right_u == q.right_u && p.depth_m == q.depth_m &&
                  p.angle_deg == q.angle_deg && p.octave == q.octave);
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Sensors, FeatureSourceTest, ::testing::Values("rgbd", "stereo", "mono"));

TEST_F(FeatureSourceTest, StereoMeasuresTheDepthThatIsThere) {
  const PreparedSequence pairs(make("stereo")), depths(make("rgbd"));
  ExtractingSource source(pairs, sensor_of(pairs), orb());
  const auto features = source.features(1);
  const auto truth = depths.frame(1).depth;
  std::vector<double> errors;
  for (const KeyPoint& p : features->keypoints()) {
    const double true_m = truth.at(static_cast<int>(p.u + 0.5f), static_cast<int>(p.v + 0.5f)) *
                          depths.depth_unit_m();
    if (!p.has_depth() || true_m == 0) continue;
    errors.push_back(std::abs(p.depth_m - true_m) / true_m);
  }
  EXPECT_GT(errors.size(), static_cast<std::size_t>(features->size()) / 2);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.02);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.1);
}

TEST_F(FeatureSourceTest, AMonocularFrameHasNoDepthAnywhere) {
  const PreparedSequence sequence(make("mono"));
  ExtractingSource source(sequence, sensor_of(sequence), orb());
  const auto features = source.features(0);
  EXPECT_FALSE(features->sensor().metric());
  EXPECT_TRUE(std::ranges::none_of(
      features->keypoints(), [](const KeyPoint& p) { return p.has_depth() || p.right_u >= 0; }));
}

}  // namespace
}  // namespace slambed
