// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "geometry/se3.hpp"

namespace slambed {

/// Returns the camera poses T_cw that see three world points along three directions, which are unit
/// vectors in the camera frame. Solves Grunert's equations (Haralick et al. 1994) and polishes the
/// roots of the quartic by Newton steps. Up to four solutions; none for degenerate triangles.
std::vector<SE3> solve_p3p(const std::array<Eigen::Vector3d, 3>& p_w,
                           const std::array<Eigen::Vector3d, 3>& directions);

}  // namespace slambed
