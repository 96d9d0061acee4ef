// SPDX-License-Identifier: Apache-2.0
#include "geometry/se3.hpp"

#include "base/portable_math.hpp"
#include "geometry/skew.hpp"

namespace slambed {
namespace {

/// Below this angle (rad) the closed forms lose digits and the Taylor series are exact to rounding.
constexpr double kSmallAngle = 1e-2;

/// sin(a)/a, (1 - cos(a))/a^2 and (a - sin(a))/a^3.
struct RotationSeries {
  double sine, versine, cubic;

  explicit RotationSeries(double angle) {
    const double a2 = angle * angle;
    if (angle < kSmallAngle) {
      sine = 1 - a2 / 6 * (1 - a2 / 20 * (1 - a2 / 42));
      versine = 0.5 * (1 - a2 / 12 * (1 - a2 / 30 * (1 - a2 / 56)));
      cubic = (1 - a2 / 20 * (1 - a2 / 42 * (1 - a2 / 72))) / 6;
    } else {
      const double half_sine = portable::sin(0.5 * angle);
      sine = portable::sin(angle) / angle;
      versine = 2 * half_sine * half_sine / a2;
      cubic = (1 - sine) / a2;
    }
  }
};

}  // namespace

SE3 SE3::exp(const Eigen::Matrix<double, 6, 1>& twist) {
  const Eigen::Vector3d rho = twist.head<3>(), phi = twist.tail<3>();
  const RotationSeries f(phi.norm());
  const Eigen::Matrix3d K = skew(phi), K2 = K * K;
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity() + f.sine * K + f.versine * K2;
  return {R, rho + f.versine * (K * rho) + f.cubic * (K2 * rho)};
}

Eigen::Matrix<double, 6, 1> SE3::log() const {
  // Uses the quaternion, whose half angle stays well conditioned near pi, unlike the trace.
  Eigen::Quaterniond q = quaternion().normalized();
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double half_sine = q.vec().norm();
  const double angle = 2 * portable::atan2(half_sine, q.w());
  const double a2 = angle * angle;
  const double scale = half_sine > 0 ? angle / half_sine : 2;
  const double inverse_cubic = angle < kSmallAngle ? (1 + a2 / 60 * (1 + a2 / 42)) / 12
                                                   : (1 - 0.5 * angle * q.w() / half_sine) / a2;
  const Eigen::Vector3d phi = scale * q.vec();
  const Eigen::Vector3d turned = phi.cross(t);
  Eigen::Matrix<double, 6, 1> twist;
  twist << t - 0.5 * turned + inverse_cubic * phi.cross(turned), phi;
  return twist;
}

}  // namespace slambed
