// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/se3.hpp"

namespace slambed {

/// Triangulates one point from two views by the linear method (DLT). x1 and x2 are normalized image
/// coordinates, ((u - cx) / fx, (v - cy) / fy); P1 and P2 are [R | t] of world to camera. Returns
/// nothing when the point is at infinity or not finite. The caller must check depth and
/// reprojection error.
std::optional<Eigen::Vector3d> triangulate(const Eigen::Matrix<double, 3, 4>& P1,
                                           const Eigen::Matrix<double, 3, 4>& P2,
                                           const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);

/// Triangulates from poses. Also returns nothing when the point is not in front of both cameras.
std::optional<Eigen::Vector3d> triangulate(const SE3& T_1w, const SE3& T_2w,
                                           const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);

/// Cosine of the angle between the two viewing rays, in the world frame.
double cos_parallax(const SE3& T_1w, const SE3& T_2w, const Eigen::Vector2d& x1,
                    const Eigen::Vector2d& x2);

}  // namespace slambed
