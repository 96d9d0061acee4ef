// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::orbslam2 {

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {
  return {
      ParameterSpec::integer("n_orb", 50, 10000),
      ParameterSpec::boolean("loop_closing"),
      ParameterSpec::boolean("second_hypotheses"),
      ParameterSpec::boolean("contention"),
      ParameterSpec::boolean("sequential"),
      ParameterSpec::path("prior_map"),
      ParameterSpec::boolean("save_map"),
  };
}
// clang-format on

}  // namespace slambed::orbslam2
