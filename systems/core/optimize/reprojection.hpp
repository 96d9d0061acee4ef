// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include "geometry/camera.hpp"

namespace slambed {

/// Depth (m) below which a point counts as behind the camera, because its derivative is unusable.
inline constexpr double kMinDepth_m = 1e-3;
/// Chi-square of a point behind the camera, like an error of 1000 px. Pushing a point through the
/// image plane thus never pays, yet a single bad point cannot block every step.
inline constexpr double kBehindChi2 = 1e6;

/// Huber loss of a squared error: quadratic up to the limit, linear in the error above it.
struct Huber {
  double rho;     ///< the cost
  double weight;  ///< d rho / d chi2
};
inline Huber huber(double chi2, double limit) {
  if (chi2 <= limit) return {chi2, 1};
  const double root = std::sqrt(chi2 * limit);
  return {2 * root - limit, limit / root};
}

/// Pinhole intrinsics, copied from Camera so that hot loops keep them in registers.
struct Pinhole {
  double fx, fy, cx, cy, bf;
  explicit Pinhole(const Camera& c) : fx(c.fx), fy(c.fy), cx(c.cx), cy(c.cy), bf(c.bf) {}
};

/// One measurement; right_weight is 0 for a monocular one.
struct Measurement {
  double u, v, right_u;
  double weight, right_weight;  ///< 1 / px^2
  double chi2_limit;
};

/// Reprojection error of a point in the camera frame, measured minus predicted, px.
struct ReprojectionError {
  double inverse_z, u, v, right_u, chi2;

  ReprojectionError(const Pinhole& c, const Measurement& m, double x, double y, double z) {
    inverse_z = 1 / z;
    const double predicted_u = c.fx * x * inverse_z + c.cx;
    u = m.u - predicted_u;
    v = m.v - (c.fy * y * inverse_z + c.cy);
    right_u = m.right_u - (predicted_u - c.bf * inverse_z);
    chi2 = m.weight * (u * u + v * v) + m.right_weight * right_u * right_u;
  }
};

}  // namespace slambed
