// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "geometry/se3.hpp"

namespace slambed {

/// Camera poses T_cw from which three world points are seen along three directions (Grunert's
/// equations as given by Haralick et al. 1994, quartic polished by Newton steps). directions: unit
/// vectors in the camera frame. Up to four solutions; none for degenerate triangles.
std::vector<SE3> solve_p3p(const std::array<Eigen::Vector3d, 3>& p_w,
                           const std::array<Eigen::Vector3d, 3>& directions);

}  // namespace slambed
