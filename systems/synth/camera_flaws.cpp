// SPDX-License-Identifier: Apache-2.0
#include "synth/camera_flaws.hpp"

#include <algorithm>
#include <cmath>

#include "synth/random.hpp"

namespace slambed::synth {
namespace {

/// Duration of the transition of light and noise around the start line.
constexpr double kChange_s = 6;

/// Returns 0 in the first lap and 1 in the second, with a smooth transition.
double in_second_lap(const LapChange& laps, double time_s) {
  const double x = std::clamp((time_s - laps.second_lap_s) / kChange_s + 0.5, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

}  // namespace

Camera true_camera(Camera believed, const CameraFlaws& flaws) {
  believed.fx /= 1 + flaws.focal_error;
  believed.fy /= 1 + flaws.focal_error;
  believed.bf /= 1 + flaws.focal_error;  // the calibrated baseline has no error
  return believed;
}

Eigen::Matrix3d right_rotation(const CameraFlaws& flaws) {
  const SinCos yaw = sincos_deg(flaws.right_yaw_deg), pitch = sincos_deg(flaws.right_pitch_deg);
  const SinCos roll = sincos_deg(flaws.right_roll_deg);
  Eigen::Matrix3d Y, X, Z;
  Y << yaw.cos, 0, yaw.sin, 0, 1, 0, -yaw.sin, 0, yaw.cos;
  X << 1, 0, 0, 0, pitch.cos, -pitch.sin, 0, pitch.sin, pitch.cos;
  Z << roll.cos, -roll.sin, 0, roll.sin, roll.cos, 0, 0, 0, 1;
  return Y * X * Z;
}

double exposure_gain(const CameraFlaws& flaws, const LapChange& laps, std::uint64_t seed,
                     double time_s) {
  Random random(seed, 0x40000);
  double wander = 0;
  for (const double period_s : {31.0, 13.0, 5.7})
    wander += sincos_turns(time_s / period_s + random.uniform()).sin / 3;
  const double lap = 1 + (laps.brightness - 1) * in_second_lap(laps, time_s);
  return lap * (1 + flaws.exposure_wander * wander);
}

double noise_gain(const LapChange& laps, double time_s) {
  return 1 + (laps.noise - 1) * in_second_lap(laps, time_s);
}

Lens::Lens(const Camera& camera, double distortion) : width_(camera.width), height_(camera.height) {
  if (distortion == 0) return;
  const std::size_t pixels = static_cast<std::size_t>(width_) * height_;
  from_x_.resize(pixels);
  from_y_.resize(pixels);
  straight_.resize(pixels);
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const double u = (x - camera.cx) / camera.fx, v = (y - camera.cy) / camera.fy;
      const double stretch = 1 + distortion * (u * u + v * v);
      const std::size_t i = static_cast<std::size_t>(y) * width_ + x;
      from_x_[i] =
          static_cast<float>(std::clamp(camera.cx + camera.fx * u * stretch, 0.0, width_ - 1.001));
      from_y_[i] =
          static_cast<float>(std::clamp(camera.cy + camera.fy * v * stretch, 0.0, height_ - 1.001));
    }
}

void Lens::bend(std::vector<float>& image) {
  if (from_x_.empty()) return;
  std::swap(image, straight_);
  for (std::size_t i = 0; i < image.size(); ++i) {
    const float x = from_x_[i], y = from_y_[i];
    const int left = static_cast<int>(x), top = static_cast<int>(y);
    const float right = x - static_cast<float>(left), down = y - static_cast<float>(top);
    const float* a = straight_.data() + static_cast<std::size_t>(top) * width_ + left;
    const float* b = a + width_;
    const float above = a[0] + (a[1] - a[0]) * right, below = b[0] + (b[1] - b[0]) * right;
    image[i] = above + (below - above) * down;
  }
}

}  // namespace slambed::synth
