// SPDX-License-Identifier: Apache-2.0
#include "geometry/camera.hpp"

#include <gtest/gtest.h>

namespace slambed {
namespace {

/// A real lens with strong distortion: the published calibration of TUM RGB-D freiburg1.
Camera strong_lens() {
  return {640,        480,        517.306408, 516.469215,
          318.643040, 255.313989, 40,         {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}};
}

/// Applies the distortion, written from OpenCV's documented formula.
Eigen::Vector2d by_formula(const Camera& c, const Eigen::Vector2d& pixel) {
  const double x = (pixel.x() - c.cx) / c.fx, y = (pixel.y() - c.cy) / c.fy, r2 = x * x + y * y;
  const auto& [k1, k2, p1, p2, k3] = c.distortion;
  const double radial = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
  const double xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  const double yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  return {c.fx * xd + c.cx, c.fy * yd + c.cy};
}

TEST(CameraTest, UndistortInvertsTheLensOverTheWholeImage) {
  const Camera camera = strong_lens();
  for (int v = 0; v <= camera.height; v += 20) {
    for (int u = 0; u <= camera.width; u += 20) {
      const Eigen::Vector2d ideal = camera.undistort(u, v);
      EXPECT_LT((by_formula(camera, ideal) - Eigen::Vector2d(u, v)).norm(), 1e-6) << u << " " << v;
    }
  }
}

TEST(CameraTest, DistortIsTheLensAndUndistortsInverse) {
  const Camera camera = strong_lens();
  for (int v = 0; v <= camera.height; v += 20) {
    for (int u = 0; u <= camera.width; u += 20) {
      const Eigen::Vector2d raw = camera.distort(u, v);
      EXPECT_LT((raw - by_formula(camera, {u, v})).norm(), 1e-9) << u << " " << v;
      const Eigen::Vector2d ideal = camera.undistort(u, v);
      EXPECT_LT((camera.distort(ideal.x(), ideal.y()) - Eigen::Vector2d(u, v)).norm(), 1e-6)
          << u << " " << v;
    }
  }
}

TEST(CameraTest, WithoutDistortionAPixelStaysWhereItIs) {
  Camera camera = strong_lens();
  camera.distortion = {};
  EXPECT_EQ(camera.undistort(12.25, 400.5), Eigen::Vector2d(12.25, 400.5));
  EXPECT_EQ(camera.distort(12.25, 400.5), Eigen::Vector2d(12.25, 400.5));
  const ImageBounds bounds = undistorted_bounds(camera);
  EXPECT_EQ(bounds.min_x, 0);
  EXPECT_EQ(bounds.max_x, 640);
  EXPECT_EQ(bounds.max_y, 480);
}

TEST(CameraTest, BoundsHoldEveryUndistortedPixel) {
  for (const double k1 : {0.15, -0.15}) {  // pincushion and barrel, both invertible here
    Camera camera = strong_lens();
    camera.distortion = {k1, 0, 0, 0, 0};
    const ImageBounds bounds = undistorted_bounds(camera);
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; u += (v % 40 == 0) ? 1 : camera.width - 1) {
        const Eigen::Vector2d p = camera.undistort(u, v);
        ASSERT_TRUE(bounds.contains(p.x(), p.y())) << k1 << " " << u << " " << v;
      }
    }
  }
}

TEST(CameraTest, ImpossibleLensGivesFiniteNumbers) {
  Camera camera = strong_lens();
  camera.distortion = {-5, 20, 0.5, 0.5, -80};
  EXPECT_TRUE(camera.undistort(0, 0).allFinite());
  EXPECT_TRUE(camera.undistort(640, 480).allFinite());
}

TEST(CameraTest, ProjectInvertsUnproject) {
  const Camera camera = strong_lens();
  EXPECT_LT((camera.project(camera.unproject(100, 50, 2.5)) - Eigen::Vector2d(100, 50)).norm(),
            1e-10);
  EXPECT_NEAR(camera.baseline_m(), 0.0773, 1e-4);
}

}  // namespace
}  // namespace slambed
