// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "features/image.hpp"
#include "synth/camera_flaws.hpp"
#include "synth/camera_path.hpp"
#include "synth/labels.hpp"

namespace slambed::synth {

/// Deviations of a real sensor from the ideal picture.
struct SensorOptions {
  std::uint64_t seed = 1;
  double motion_blur_s = 0;  ///< exposure time; the timestamp is its middle
  double noise = 0;          ///< standard deviation, gray levels
  double depth_noise = 0;    ///< 1: a Kinect's axial noise (Nguyen, Izadi, Lovell 2012)
  double depth_holes =
      0;  ///< share of pixels lost in patches; above 0 edges and slants are lost too
  double depth_unit_m = 0.0002;
  double max_depth_m = 10;
  double baseline_m = 0;                            ///< of the right camera, for stereo
  double blackout_start_s = 0, blackout_end_s = 0;  ///< lens covered in [start, end)
  CameraFlaws flaws{};
  LapChange laps{};
  double nearest_m = 1.5;  ///< distance of the scene that sets the number of blur samples
  int most_samples = 12;   ///< per pixel
};

/// One recorded frame. Depth and right are empty unless requested.
struct Shot {
  std::vector<std::uint8_t> gray, right;
  std::vector<std::uint16_t> depth;
};

/// Takes pictures along a path. It owns a renderer and scratch memory, so every thread needs its
/// own.
class SensorModel {
 public:
  SensorModel(std::shared_ptr<const Scene> scene, const Camera& camera, SensorOptions options);

  /// Takes gray and depth; time_s is mid-exposure.
  Shot capture_rgbd(const CameraPath& path, int frame, double time_s);
  /// Takes left and right gray of a rectified pair.
  Shot capture_stereo(const CameraPath& path, int frame, double time_s);
  /// Takes gray only.
  Shot capture_mono(const CameraPath& path, int frame, double time_s);
  /// Returns the true labels of the people in the picture; none while the lens is covered.
  std::vector<PersonLabel> label(const CameraPath& path, std::span<const Figure> cast,
                                 double time_s);

 private:
  std::vector<std::uint8_t> expose(const CameraPath& path, int frame, double time_s,
                                   double baseline_m, std::uint32_t stream);
  void expose_sample(const CameraPath& path, double time_s, double baseline_m, double across,
                     double down);
  int samples_for(const CameraPath& path, double time_s) const;
  std::vector<std::uint16_t> measure_depth(int frame) const;
  bool covered(double time_s) const;

  Renderer renderer_;
  SensorOptions options_;
  Lens lens_;
  Eigen::Matrix3d right_rotation_;
  std::vector<float> sum_, depth_m_;
};

}  // namespace slambed::synth
