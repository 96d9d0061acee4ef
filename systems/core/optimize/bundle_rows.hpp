// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "optimize/reprojection.hpp"

namespace slambed {

/// The observations of a bundle, sorted by point and then by pose, one array per number as the
/// kernels require. Rows of point i are [begin[i], begin[i + 1]).
struct BundleRows {
  std::vector<double> u, v, right_u;         ///< px
  std::vector<double> weight, right_weight;  ///< 1 / px^2; right_weight is 0 for monocular rows
  std::vector<double> chi2_limit;
  std::vector<std::uint32_t> pose, point;
  std::vector<std::uint32_t> original;  ///< index in the caller's list
  std::vector<std::uint8_t> active;
  std::vector<std::uint32_t> begin;
  int free_poses = 0;  ///< poses below this index move

  std::size_t size() const { return original.size(); }
  Measurement measurement(std::size_t k) const {
    return {u[k], v[k], right_u[k], weight[k], right_weight[k], chi2_limit[k]};
  }
};

}  // namespace slambed
