// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "geometry/alignment.hpp"

namespace slambed {

/// Tangent vector of a similarity (rho, phi, sigma): translation part, rotation vector (rad),
/// logarithm of the scale.
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

Sim3 sim3_exp(const Vector7& tangent);
/// Inverse of sim3_exp; rotation angles in [0, pi].
Vector7 sim3_log(const Sim3& S);
/// Returns Ad with S exp(x) S^-1 = exp(Ad x).
Matrix7 sim3_adjoint(const Sim3& S);
/// Returns the inverse left Jacobian J: log(exp(d) exp(x)) = x + J d for small d. The right one is
/// that of -x. Accurate for rotations below about 2 rad; pose graph errors are smaller.
Matrix7 sim3_left_jacobian_inverse(const Vector7& x);

/// Projects R back onto SO(3); call after long chains of products.
inline Sim3 normalized(const Sim3& S) {
  return {S.scale, Eigen::Quaterniond(S.R).normalized().toRotationMatrix(), S.t};
}
inline Sim3 to_sim3(const SE3& T) { return {1, T.R, T.t}; }
/// Returns the camera pose in a world with points S^-1 * p_c: the translation is divided by scale.
inline SE3 to_se3(const Sim3& S) { return SE3(S.R, S.t / S.scale); }

}  // namespace slambed
