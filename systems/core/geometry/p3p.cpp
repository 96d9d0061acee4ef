// SPDX-License-Identifier: Apache-2.0
#include "geometry/p3p.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace slambed {
namespace {

/// A triangle has no stable pose when its doubled area is below this share of its longest side
/// squared.
constexpr double kMinRelativeArea = 1e-6;
/// Imaginary parts up to this size come from double roots split by rounding.
constexpr double kMaxImaginary = 1e-4;
constexpr int kNewtonSteps = 3;

using Quartic = std::array<double, 5>;  ///< coefficients, highest power first

std::vector<double> real_roots(const Quartic& c) {
  std::vector<double> roots;
  double largest = 0;
  for (const double value : c) largest = std::max(largest, std::abs(value));
  if (!std::isfinite(largest) || std::abs(c[0]) <= 1e-12 * largest) return roots;
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  for (int i = 0; i < 4; ++i) companion(0, i) = -c[i + 1] / c[0];
  companion.bottomLeftCorner<3, 3>().setIdentity();
  const Eigen::Vector4cd values = companion.eigenvalues();
  for (int i = 0; i < 4; ++i) {
    if (std::abs(values[i].imag()) > kMaxImaginary * (1 + std::abs(values[i].real()))) continue;
    double x = values[i].real();
    for (int step = 0; step < kNewtonSteps; ++step) {
      const double f = (((c[0] * x + c[1]) * x + c[2]) * x + c[3]) * x + c[4];
      const double slope = ((4 * c[0] * x + 3 * c[1]) * x + 2 * c[2]) * x + c[3];
      if (slope == 0) break;
      x -= f / slope;
    }
    if (std::isfinite(x)) roots.push_back(x);
  }
  return roots;
}

/// Returns an orthonormal frame: x along the first side, z along the normal of the triangle.
Eigen::Matrix3d triangle_frame(const std::array<Eigen::Vector3d, 3>& p) {
  Eigen::Matrix3d frame;
  frame.col(0) = (p[1] - p[0]).normalized();
  frame.col(2) = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

Quartic grunert(double a2, double b2, double c2, double cos_a, double cos_b, double cos_g) {
  const double minus = (a2 - c2) / b2, plus = (a2 + c2) / b2;
  const double ra = a2 / b2, rc = c2 / b2;
  return {
      (minus - 1) * (minus - 1) - 4 * rc * cos_a * cos_a,
      4 * (minus * (1 - minus) * cos_b - (1 - plus) * cos_a * cos_g +
           2 * rc * cos_a * cos_a * cos_b),
      2 * (minus * minus - 1 + 2 * minus * minus * cos_b * cos_b + 2 * (1 - rc) * cos_a * cos_a -
           4 * plus * cos_a * cos_b * cos_g + 2 * (1 - ra) * cos_g * cos_g),
      4 * (-minus * (1 + minus) * cos_b + 2 * ra * cos_g * cos_g * cos_b -
           (1 - plus) * cos_a * cos_g),
      (1 + minus) * (1 + minus) - 4 * ra * cos_g * cos_g};
}

}  // namespace

std::vector<SE3> solve_p3p(const std::array<Eigen::Vector3d, 3>& p_w,
                           const std::array<Eigen::Vector3d, 3>& f) {
  std::vector<SE3> poses;
  const double a2 = (p_w[1] - p_w[2]).squaredNorm();
  const double b2 = (p_w[0] - p_w[2]).squaredNorm();
  const double c2 = (p_w[0] - p_w[1]).squaredNorm();
  const double area = (p_w[1] - p_w[0]).cross(p_w[2] - p_w[0]).norm();
  const double longest = std::max({a2, b2, c2});
  if (!std::isfinite(longest) || !(area > kMinRelativeArea * longest)) return poses;

  const double cos_a = f[1].dot(f[2]), cos_b = f[0].dot(f[2]), cos_g = f[0].dot(f[1]);
  const Eigen::Matrix3d world = triangle_frame(p_w);
  const double minus = (a2 - c2) / b2;
  for (const double v : real_roots(grunert(a2, b2, c2, cos_a, cos_b, cos_g))) {
    const double denominator = 2 * (cos_g - v * cos_a);
    const double s1_squared = b2 / (1 + v * v - 2 * v * cos_b);
    if (v <= 0 || denominator == 0 || !(s1_squared > 0)) continue;
    const double u = ((minus - 1) * v * v - 2 * minus * cos_b * v + 1 + minus) / denominator;
    if (!(u > 0) || !std::isfinite(u)) continue;
    const double s1 = std::sqrt(s1_squared);
    const std::array<Eigen::Vector3d, 3> p_c{s1 * f[0], u * s1 * f[1], v * s1 * f[2]};
    const Eigen::Matrix3d R = triangle_frame(p_c) * world.transpose();
    if (!R.allFinite()) continue;
    poses.emplace_back(R, p_c[0] - R * p_w[0]);
  }
  return poses;
}

}  // namespace slambed
