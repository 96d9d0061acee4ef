// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace slambed {

/// Rigid transform. T_ab maps a point from frame b to frame a: p_a = T_ab * p_b.
/// T_cw: world to camera (x right, y down, z forward), meters.
struct SE3 {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  SE3() = default;
  SE3(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : R(rotation), t(translation) {}
  SE3(const Eigen::Quaterniond& q, const Eigen::Vector3d& translation)
      : R(q.normalized().toRotationMatrix()), t(translation) {}

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return R * p + t; }
  SE3 operator*(const SE3& o) const { return {R * o.R, R * o.t + t}; }
  SE3 inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
  Eigen::Quaterniond quaternion() const { return Eigen::Quaterniond(R); }

  /// Exponential map of a twist (rho, phi): translation part first, then rotation vector (radians).
  static SE3 exp(const Eigen::Matrix<double, 6, 1>& twist);
  /// Inverse of exp; rotation angles in [0, pi].
  Eigen::Matrix<double, 6, 1> log() const;
  /// Projects R back onto SO(3); call after long chains of products.
  SE3 normalized() const { return {quaternion(), t}; }
};

}  // namespace slambed
