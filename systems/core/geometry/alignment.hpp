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

/// Returns the least-squares rigid transform with to[i] ~ T * from[i] (Umeyama 1991). Returns
/// nothing for fewer than three pairs, spans of different size, a value that is not finite, or
/// collinear points.
std::optional<SE3> align_se3(std::span<const Eigen::Vector3d> from,
                             std::span<const Eigen::Vector3d> to);

/// Like align_se3, but also estimates the scale.
std::optional<Sim3> align_sim3(std::span<const Eigen::Vector3d> from,
                               std::span<const Eigen::Vector3d> to);

}  // namespace slambed
