// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/se3.hpp"

namespace slambed {

/// Similarity transform: p_a = scale * R * p_b + t.
struct Sim3 {
  double scale = 1;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return scale * (R * p) + t; }
  Sim3 operator*(const Sim3& o) const { return {scale * o.scale, R * o.R, *this * o.t}; }
  Sim3 inverse() const {
    const Eigen::Matrix3d Rt = R.transpose();
    return {1 / scale, Rt, -(Rt * t) / scale};
  }
};

/// Least-squares rigid transform with p_to[i] ~ T * p_from[i] (Umeyama 1991). Nothing when there
/// are fewer than three pairs, the numbers differ, a value is not finite or the points lie on one
/// line.
std::optional<SE3> align_se3(std::span<const Eigen::Vector3d> from,
                             std::span<const Eigen::Vector3d> to);

/// The same with scale.
std::optional<Sim3> align_sim3(std::span<const Eigen::Vector3d> from,
                               std::span<const Eigen::Vector3d> to);

}  // namespace slambed
