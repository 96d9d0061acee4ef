// SPDX-License-Identifier: Apache-2.0
#include "synth/camera_flaws.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "synth/sensor.hpp"
#include "synth/street.hpp"

namespace slambed::synth {
namespace {

Camera camera_of(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.55 * width;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

TEST(CameraFlaws, TheBelievedFocalLengthIsOffByTheError) {
  const Camera believed = camera_of(640, 360);
  const Camera real = true_camera(believed, {.focal_error = 0.02});
  EXPECT_NEAR(believed.fx / real.fx, 1.02, 1e-12);
  EXPECT_EQ(true_camera(believed, {}).fx, believed.fx);
}

TEST(CameraFlaws, LensMovesAPointAsItsFormulaSays) {
  const Camera camera = camera_of(200, 100);
  std::vector<float> image(200 * 100, 0);
  // Brightness equals the column, so a pixel's value is the position of its source.
  for (int i = 0; i < 200 * 100; ++i) image[i] = static_cast<float>(i % 200);
  Lens lens(camera, 0.03);
  lens.bend(image);
  for (const int x : {30, 60, 99, 140, 170}) {
    const double u = (x - camera.cx) / camera.fx, v = (20 - camera.cy) / camera.fy;
    const double wanted = camera.cx + camera.fx * u * (1 + 0.03 * (u * u + v * v));
    EXPECT_NEAR(image[20 * 200 + x], wanted, 1e-3) << x;
  }
  std::vector<float> untouched(200 * 100, 7);
  Lens(camera, 0).bend(untouched);
  EXPECT_EQ(untouched, std::vector<float>(200 * 100, 7));
}

TEST(CameraFlaws, TheSecondLapIsDarkerAndNoisier) {
  const LapChange laps{.second_lap_s = 50, .brightness = 0.9, .noise = 1.3};
  EXPECT_EQ(exposure_gain({}, laps, 1, 10), 1);
  EXPECT_NEAR(exposure_gain({}, laps, 1, 60), 0.9, 1e-12);
  EXPECT_NEAR(noise_gain(laps, 60), 1.3, 1e-12);
  double low = 9, high = 0;
  for (double t = 0; t < 40; t += 0.5) {
    const double gain = exposure_gain({.exposure_wander = 0.2}, laps, 1, t);
    low = std::min(low, gain);
    high = std::max(high, gain);
  }
  EXPECT_GT(low, 0.79);
  EXPECT_LT(high, 1.21);
  EXPECT_GT(high - low, 0.1);
}

class FlawedPicture : public testing::Test {
 protected:
  static double changed_by(const CameraFlaws& flaws, bool right, double time_s) {
    const auto drive = std::make_shared<const Drive>("block", 4);
    static const auto scene = make_street({.seed = 4, .texel_scale = 8}, drive);
    const auto take = [&](const CameraFlaws& f) {
      SensorOptions options;
      options.baseline_m = 0.12;
      options.flaws = f;
      const Camera camera = true_camera(camera_of(320, 180), f);
      const Shot shot = SensorModel(scene, camera, options).capture_stereo(*drive, 0, time_s);
      return right ? shot.right : shot.gray;
    };
    const auto ideal = take({}), flawed = take(flaws);
    double sum = 0;
    for (std::size_t i = 0; i < ideal.size(); ++i) sum += std::abs(ideal[i] - flawed[i]);
    return sum / static_cast<double>(ideal.size());
  }
};

TEST_F(FlawedPicture, ATurnedRightCameraLeavesTheLeftOneAlone) {
  const CameraFlaws turned{.right_yaw_deg = 0.1, .right_pitch_deg = 0.1, .right_roll_deg = 0.1};
  EXPECT_EQ(changed_by(turned, false, 5), 0);
  EXPECT_GT(changed_by(turned, true, 5), 0.3);
}

TEST_F(FlawedPicture, ARollingShutterShowsOnlyInMotion) {
  const CameraFlaws rolling{.readout_s = 0.02};
  EXPECT_GT(changed_by(rolling, false, 8), 0.2);
  EXPECT_EQ(changed_by(rolling, false, 0.2), 0);  // the car still stands
}

}  // namespace
}  // namespace slambed::synth
