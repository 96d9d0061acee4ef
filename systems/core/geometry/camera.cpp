// SPDX-License-Identifier: Apache-2.0
#include "geometry/camera.hpp"

#include <algorithm>
#include <cmath>

namespace slambed {
namespace {

constexpr int kMaxIterations = 30;
constexpr double kConverged = 1e-12;  ///< normalized units: about 1e-9 px

}  // namespace

Eigen::Vector2d Camera::undistort(double u_raw, double v_raw) const {
  if (!distorted()) return {u_raw, v_raw};
  const auto& [k1, k2, p1, p2, k3] = distortion;
  const double x_raw = (u_raw - cx) / fx, y_raw = (v_raw - cy) / fy;
  double x = x_raw, y = y_raw;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double next_x = (x_raw - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial;
    const double next_y = (y_raw - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial;
    // The model is not invertible here, so keep the last usable value.
    if (!(radial > 0) || !std::isfinite(next_x) || !std::isfinite(next_y)) break;
    const double change = std::max(std::abs(next_x - x), std::abs(next_y - y));
    x = next_x;
    y = next_y;
    if (change < kConverged) break;
  }
  return {fx * x + cx, fy * y + cy};
}

Eigen::Vector2d Camera::distort(double u, double v) const {
  if (!distorted()) return {u, v};
  const auto& [k1, k2, p1, p2, k3] = distortion;
  const double x = (u - cx) / fx, y = (v - cy) / fy;
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx,
          fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy};
}

ImageBounds undistorted_bounds(const Camera& camera) {
  ImageBounds bounds{0, 0, double(camera.width), double(camera.height)};
  if (!camera.distorted()) return bounds;
  // Use the whole border, because under pincushion distortion the edges reach beyond the corners.
  const Eigen::Vector2d first = camera.undistort(0, 0);
  bounds = {first.x(), first.y(), first.x(), first.y()};
  const auto include = [&](double u, double v) {
    const Eigen::Vector2d p = camera.undistort(u, v);
    bounds.min_x = std::min(bounds.min_x, p.x());
    bounds.max_x = std::max(bounds.max_x, p.x());
    bounds.min_y = std::min(bounds.min_y, p.y());
    bounds.max_y = std::max(bounds.max_y, p.y());
  };
  for (int i = 0; i <= camera.width; ++i) {
    include(i, 0);
    include(i, camera.height);
  }
  for (int i = 0; i <= camera.height; ++i) {
    include(0, i);
    include(camera.width, i);
  }
  return bounds;
}

}  // namespace slambed
