// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace slambed::wire {

/// Largest deviation of a received quaternion's norm from 1.
inline constexpr double kUnitTolerance = 1e-3;

/// Whether a received quaternion is a rotation. False if it contains a NaN.
inline bool is_unit(const Eigen::Quaterniond& q) { return std::abs(q.norm() - 1) < kUnitTolerance; }

}  // namespace slambed::wire
