// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

namespace slambed {

/// Pinhole camera with OpenCV's radial-tangential distortion (k1, k2, p1, p2, k3) and a virtual or
/// real right camera: baseline_m = bf / fx. Pixels are undistorted unless a name says otherwise.
struct Camera {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double bf = 0;  ///< fx times baseline, px*m; 0 for a monocular camera
  std::array<double, 5> distortion{};

  double baseline_m() const { return bf / fx; }
  bool distorted() const { return distortion != std::array<double, 5>{}; }
  Eigen::Vector2d project(const Eigen::Vector3d& p_c) const {
    return {fx * p_c.x() / p_c.z() + cx, fy * p_c.y() / p_c.z() + cy};
  }
  Eigen::Vector3d unproject(double u, double v, double depth_m) const {
    return {(u - cx) / fx * depth_m, (v - cy) / fy * depth_m, depth_m};
  }
  /// Maps a raw pixel to the ideal pinhole pixel with the same K (fixed-point iteration).
  Eigen::Vector2d undistort(double u_raw, double v_raw) const;
  /// Inverse of undistort: maps an ideal pixel to the raw one.
  Eigen::Vector2d distort(double u, double v) const;
};

/// Axis-aligned pixel bounds of the undistorted image.
struct ImageBounds {
  double min_x = 0, min_y = 0, max_x = 0, max_y = 0;
  bool contains(double u, double v) const {
    return u >= min_x && u < max_x && v >= min_y && v < max_y;
  }
};
ImageBounds undistorted_bounds(const Camera& camera);

}  // namespace slambed
