// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "geometry/alignment.hpp"

namespace slambed {

/// Tangent vector of a similarity: (rho, phi, sigma) = translation part, rotation vector (rad),
/// logarithm of the scale.
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

Sim3 sim3_exp(const Vector7& tangent);
/// Inverse of sim3_exp; rotation angles in [0, pi].
Vector7 sim3_log(const Sim3& S);
/// S exp(x) S^-1 = exp(Ad x).
Matrix7 sim3_adjoint(const Sim3& S);
/// Inverse of the left Jacobian: log(exp(d) exp(x)) = x + J d for small d. The right one is that of
/// -x. Precise for rotations below about 2 rad, more than any error that a pose graph can mend.
Matrix7 sim3_left_jacobian_inverse(const Vector7& x);

/// R back onto SO(3); call after long chains of products.
inline Sim3 normalized(const Sim3& S) {
  return {S.scale, Eigen::Quaterniond(S.R).normalized().toRotationMatrix(), S.t};
}
inline Sim3 to_sim3(const SE3& T) { return {1, T.R, T.t}; }
/// The pose of a camera in a world whose points are S^-1 * p_c: its translation loses the scale.
inline SE3 to_se3(const Sim3& S) { return SE3(S.R, S.t / S.scale); }

}  // namespace slambed
