// SPDX-License-Identifier: Apache-2.0
#include "geometry/triangulation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "geometry/tests/draws.hpp"

namespace slambed {
namespace {

const SE3 kFirst =
    SE3::exp((Eigen::Matrix<double, 6, 1>() << 0, 0, 0, 0.02, -0.1, 0.03).finished());
const SE3 kSecond =
    SE3::exp((Eigen::Matrix<double, 6, 1>() << -0.3, 0.05, 0.1, -0.05, 0.1, 0.0).finished());

Eigen::Vector2d view(const SE3& T_cw, const Eigen::Vector3d& p_w) {
  return (T_cw * p_w).hnormalized();
}

TEST(TriangulationTest, RecoversExactPoints) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> side(-1.5, 1.5), depth(1, 8);
  for (int i = 0; i < 200; ++i) {
    const double z = depth(random), y = side(random), x = side(random);
    const Eigen::Vector3d p(x, y, z);
    const auto got = triangulate(kFirst, kSecond, view(kFirst, p), view(kSecond, p));
    ASSERT_TRUE(got);
    EXPECT_LT((*got - p).norm(), 1e-9);
  }
}

TEST(TriangulationTest, NoiseOfHalfAPixelMovesThePointLittle) {
  std::mt19937 random(8);
  std::normal_distribution<double> noise(0, 0.5 / 500);
  const Eigen::Vector3d p(0.2, -0.3, 2);
  double sum = 0;
  for (int i = 0; i < 200; ++i) {
    const auto error = [&] { return drawn<2>([&] { return noise(random); }); };
    const Eigen::Vector2d e1 = error(), e2 = error();
    const auto got = triangulate(kFirst, kSecond, view(kFirst, p) + e1, view(kSecond, p) + e2);
    ASSERT_TRUE(got);
    sum += (*got - p).squaredNorm();
  }
  // z^2 / baseline * sigma * sqrt(2) = 18 mm for this pair; more than twice that means a bug.
  EXPECT_LT(std::sqrt(sum / 200), 0.036);
}

TEST(TriangulationTest, RefusesPointsBehindTheCameras) {
  const Eigen::Vector3d p(0.2, 0.1, -3);
  EXPECT_FALSE(triangulate(kFirst, kSecond, view(kFirst, p), view(kSecond, p)));
}

TEST(TriangulationTest, RefusesParallelRaysAndBadNumbers) {
  const SE3 shifted(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-1, 0, 0));
  EXPECT_FALSE(triangulate(SE3(), shifted, {0.1, 0.2}, {0.1, 0.2}));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(triangulate(kFirst, kSecond, {nan, 0}, {0, 0}));
}

TEST(TriangulationTest, ParallaxOfAKnownTriangle) {
  // The point (0, 0, 1) seen from the origin and from one meter to the right: 45 degrees.
  const SE3 right(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-1, 0, 0));
  EXPECT_NEAR(cos_parallax(SE3(), right, {0, 0}, {-1, 0}), std::sqrt(0.5), 1e-14);
}

}  // namespace
}  // namespace slambed
