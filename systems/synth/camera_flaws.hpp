// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed::synth {

/// Flaws of real cameras on a car. With all values 0 the camera is ideal.
struct CameraFlaws {
  double focal_error = 0;    ///< the calibration's focal length is the true one times 1 + this
  double distortion = 0;     ///< residual after undistortion: a ray's slope times 1 + this r^2
  double right_yaw_deg = 0;  ///< rotation of the right camera against the left one
  double right_pitch_deg = 0;
  double right_roll_deg = 0;
  double readout_s = 0;        ///< rolling shutter: from the first row to the last
  double exposure_wander = 0;  ///< relative amplitude of the brightness drift
};

/// Changes of light and noise from the first lap of a drive to the second.
struct LapChange {
  double second_lap_s = std::numeric_limits<double>::infinity();
  double brightness = 0.88;  ///< of the second lap, relative to the first
  double noise = 1.25;       ///< of the second lap, relative to the first
};

/// Returns the camera that renders the pictures. `believed` is the calibration that the sequence
/// states.
Camera true_camera(Camera believed, const CameraFlaws& flaws);

/// Rotation of the right camera in the left camera's frame.
Eigen::Matrix3d right_rotation(const CameraFlaws& flaws);

/// Returns the factor on the brightness of a picture.
double exposure_gain(const CameraFlaws& flaws, const LapChange& laps, std::uint64_t seed,
                     double time_s);
double noise_gain(const LapChange& laps, double time_s);

/// Applies the residual distortion to an ideal picture.
class Lens {
 public:
  Lens(const Camera& camera, double distortion);
  void bend(std::vector<float>& image);

 private:
  int width_ = 0, height_ = 0;
  std::vector<float> from_x_, from_y_;  ///< source of each pixel; empty: no distortion
  std::vector<float> straight_;
};

}  // namespace slambed::synth
