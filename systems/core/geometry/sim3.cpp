// SPDX-License-Identifier: Apache-2.0
#include "geometry/sim3.hpp"

#include <Eigen/LU>
#include <cmath>

#include "base/portable_math.hpp"
#include "geometry/skew.hpp"

namespace slambed {
namespace {

/// Below this size the closed forms lose digits, and the series are exact to rounding.
constexpr double kSmall = 1e-2;

/// Returns the integral over s in [0, 1] of s^n exp(sigma s), from its power series in sigma.
double moment(int n, double sigma) {
  double sum = 0, factor = 1;
  for (int k = 0; k < 12; ++k) {
    sum += factor / (n + k + 1);
    factor *= sigma / (k + 1);
  }
  return sum;
}

/// Returns W with t = W rho: the integral of exp(s (sigma I + [phi]x)) over s in [0, 1], written as
/// c I + a [phi]x + b [phi]x^2.
Eigen::Matrix3d translation_map(const Eigen::Vector3d& phi, double sigma) {
  const double angle = phi.norm(), angle2 = angle * angle;
  const double c = std::abs(sigma) < kSmall ? moment(0, sigma) : portable::expm1(sigma) / sigma;
  double a, b;
  if (angle < kSmall) {
    // Integrates the series of sine and cosine term by term.
    if (std::abs(sigma) < 1) {
      a = moment(1, sigma) - angle2 / 6 * (moment(3, sigma) - angle2 / 20 * moment(5, sigma));
      b = moment(2, sigma) / 2 - angle2 / 24 * (moment(4, sigma) - angle2 / 30 * moment(6, sigma));
    } else {
      const double e = portable::exp(sigma), s2 = sigma * sigma, s3 = s2 * sigma, s4 = s2 * s2;
      a = (e * (sigma - 1) + 1) / s2 - angle2 / 6 * (e * (s3 - 3 * s2 + 6 * sigma - 6) + 6) / s4;
      b = (e * (s2 - 2 * sigma + 2) - 2) / (2 * s3);
    }
  } else {
    const double e = portable::exp(sigma), n = sigma * sigma + angle2;
    const double cosine = portable::cos(angle), sine = portable::sin(angle);
    const double of_sine = (e * (sigma * sine - angle * cosine) + angle) / n;
    const double of_cosine = (e * (sigma * cosine + angle * sine) - sigma) / n;
    a = of_sine / angle;
    b = (c - of_cosine) / angle2;
  }
  const Eigen::Matrix3d K = skew(phi);
  return c * Eigen::Matrix3d::Identity() + a * K + b * (K * K);
}

Eigen::Matrix<double, 6, 1> rotation_only(const Eigen::Vector3d& phi) {
  Eigen::Matrix<double, 6, 1> twist;
  twist << Eigen::Vector3d::Zero(), phi;
  return twist;
}

/// Returns the matrix of the Lie bracket: ad(x) y = [x, y].
Matrix7 ad(const Vector7& x) {
  const Eigen::Matrix3d K = skew(x.segment<3>(3));
  Matrix7 m = Matrix7::Zero();
  m.block<3, 3>(0, 0) = K + x(6) * Eigen::Matrix3d::Identity();
  m.block<3, 3>(0, 3) = skew(x.head<3>());
  m.block<3, 1>(0, 6) = -x.head<3>();
  m.block<3, 3>(3, 3) = K;
  return m;
}

}  // namespace

Sim3 sim3_exp(const Vector7& tangent) {
  const Eigen::Vector3d phi = tangent.segment<3>(3);
  return {portable::exp(tangent(6)), SE3::exp(rotation_only(phi)).R,
          translation_map(phi, tangent(6)) * tangent.head<3>()};
}

Vector7 sim3_log(const Sim3& S) {
  const Eigen::Vector3d phi = SE3(S.R, Eigen::Vector3d::Zero()).log().tail<3>();
  const double sigma = portable::log(S.scale);
  Vector7 tangent;
  tangent << translation_map(phi, sigma).partialPivLu().solve(S.t), phi, sigma;
  return tangent;
}

Matrix7 sim3_adjoint(const Sim3& S) {
  Matrix7 m = Matrix7::Zero();
  m.block<3, 3>(0, 0) = S.scale * S.R;
  m.block<3, 3>(0, 3) = skew(S.t) * S.R;
  m.block<3, 1>(0, 6) = -S.t;
  m.block<3, 3>(3, 3) = S.R;
  m(6, 6) = 1;
  return m;
}

Matrix7 sim3_left_jacobian_inverse(const Vector7& x) {
  // Sum of B_n / n! ad^n with the Bernoulli numbers B_n; the odd ones beyond the first are zero.
  static constexpr double kCoefficients[] = {
      1.0 / 12, -1.0 / 720, 1.0 / 30240, -1.0 / 1209600, 1.0 / 47900160, -691.0 / 1307674368000.0};
  const Matrix7 A = ad(x), A2 = A * A;
  Matrix7 sum = Matrix7::Identity() - 0.5 * A, power = Matrix7::Identity();
  for (const double coefficient : kCoefficients) {
    power = power * A2;
    sum += coefficient * power;
  }
  return sum;
}

}  // namespace slambed
