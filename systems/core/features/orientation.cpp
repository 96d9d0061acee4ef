// SPDX-License-Identifier: Apache-2.0
#include "features/orientation.hpp"

#include <cmath>
#include <initializer_list>

namespace slambed {
namespace {

/// Returns atan(z) for z in [0, 1], rad; |error| <= 2e-8 (Abramowitz & Stegun 4.4.49). It replaces
/// the C library's atan2, whose last bit differs between versions.
double atan_unit(double z) {
  const double q = z * z;
  double p = 0.0028662257;
  for (const double a : {-0.0161657367, 0.0429096138, -0.0752896400, 0.1065626393, -0.1420889944,
                         0.1999355085, -0.3333314528})
    p = p * q + a;
  return z * (1 + p * q);
}

}  // namespace

Orientation orientation_of(Moments m) {
  if (m.m10 == 0 && m.m01 == 0) return {};
  constexpr double kDegrees = 57.29577951308232;
  const double x = m.m10, y = m.m01;
  const double ax = std::abs(x), ay = std::abs(y);
  double angle = ax >= ay ? atan_unit(ay / ax) * kDegrees : 90 - atan_unit(ax / ay) * kDegrees;
  if (x < 0) angle = 180 - angle;
  if (y < 0) angle = 360 - angle;
  const double length = std::sqrt(x * x + y * y);
  Orientation o{static_cast<float>(x / length), static_cast<float>(y / length),
                static_cast<float>(angle)};
  if (o.angle_deg >= 360) o.angle_deg = 0;  // 359.99... may round up
  return o;
}

}  // namespace slambed
