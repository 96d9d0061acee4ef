// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace slambed::wire {

/// How far from 1 the norm of a received quaternion may be.
inline constexpr double kUnitTolerance = 1e-3;

/// Whether a received quaternion is a rotation; one with a NaN is none.
inline bool is_unit(const Eigen::Quaterniond& q) { return std::abs(q.norm() - 1) < kUnitTolerance; }

}  // namespace slambed::wire
