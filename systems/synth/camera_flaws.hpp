// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed::synth {

/// What real cameras on a car have and an ideal one does not. All 0: an ideal one.
struct CameraFlaws {
  double focal_error = 0;    ///< the calibration's focal length is the true one times 1 + this
  double distortion = 0;     ///< left over after undistortion: a ray's slope times 1 + this r^2
  double right_yaw_deg = 0;  ///< the right camera is turned against the left one
  double right_pitch_deg = 0;
  double right_roll_deg = 0;
  double readout_s = 0;        ///< rolling shutter: from the first row to the last
  double exposure_wander = 0;  ///< share by which brightness wanders
};

/// What differs between the laps of a drive besides the drive itself.
struct LapChange {
  double second_lap_s = std::numeric_limits<double>::infinity();
  double brightness = 0.88;  ///< of the second lap against the first
  double noise = 1.25;       ///< the same for noise
};

/// The camera that pictures are drawn with, where the given one is what its owner believes.
Camera true_camera(Camera believed, const CameraFlaws& flaws);

/// Where the right camera points, in the left one's frame.
Eigen::Matrix3d right_rotation(const CameraFlaws& flaws);

/// How bright a picture comes out.
double exposure_gain(const CameraFlaws& flaws, const LapChange& laps, std::uint64_t seed,
                     double time_s);
double noise_gain(const LapChange& laps, double time_s);

/// Bends an ideal picture as the distortion that is left over does.
class Lens {
 public:
  Lens(const Camera& camera, double distortion);
  void bend(std::vector<float>& image);

 private:
  int width_ = 0, height_ = 0;
  std::vector<float> from_x_, from_y_;  ///< where each pixel looks; empty: nothing to bend
  std::vector<float> straight_;
};

}  // namespace slambed::synth
