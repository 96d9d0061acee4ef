// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/se3.hpp"

namespace slambed {

/// Linear triangulation (DLT) of one point from two views. x1 and x2 are normalized image
/// coordinates, ((u - cx) / fx, (v - cy) / fy); the projections are [R | t] of world to camera.
/// Nothing when the point is at infinity or not finite; which side of the cameras it lies on and
/// how well it reprojects is for the caller to check.
std::optional<Eigen::Vector3d> triangulate(const Eigen::Matrix<double, 3, 4>& P1,
                                           const Eigen::Matrix<double, 3, 4>& P2,
                                           const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);

/// The same from poses; also nothing when the point is not in front of both cameras.
std::optional<Eigen::Vector3d> triangulate(const SE3& T_1w, const SE3& T_2w,
                                           const Eigen::Vector2d& x1, const Eigen::Vector2d& x2);

/// Cosine of the angle between the two viewing rays, in the world frame.
double cos_parallax(const SE3& T_1w, const SE3& T_2w, const Eigen::Vector2d& x1,
                    const Eigen::Vector2d& x2);

}  // namespace slambed
