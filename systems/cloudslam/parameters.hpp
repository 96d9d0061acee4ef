// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::cloudslam {

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {
  return {
      ParameterSpec::integer("n_orb", 50, 10000),
      ParameterSpec::choice("strategy", {"all", "periodic", "distance", "adaptive", "none"}),
      ParameterSpec::real("period_s", 0, 600),
      ParameterSpec::real("distance_m", 0, 10000),
      ParameterSpec::real("correction_threshold_m", 0, 1000),
      ParameterSpec::real("decrease", 0, 10),
      ParameterSpec::real("increase", 0, 10),
      ParameterSpec::real("distance_min_m", 0, 10000),
      ParameterSpec::real("distance_max_m", 0, 10000),
      ParameterSpec::integer("bundle_keyframes", 0, 1000),
      ParameterSpec::real("window_s", 0, 600),
      ParameterSpec::choice("back_propagation", {"graded", "rigid"}),
      ParameterSpec::real("align_rate_hz", 0.1, 100),
      ParameterSpec::real("align_timeout_s", 0, 600),
      ParameterSpec::path("prior_map"),
      ParameterSpec::real("search_radius_m", 0, 10000),
      ParameterSpec::integer("place_candidates", 0, 100),
      ParameterSpec::integer("near_candidates", 0, 100),
      ParameterSpec::integer("remote_queue", 1, 1000),
      ParameterSpec::integer("keyframe_queue", 1, 1000),
      ParameterSpec::integer("keyframe_bytes", 0, 50000000),
      ParameterSpec::choice("codec", {"binary", "compatibility"}),
      ParameterSpec::boolean("upload"),
      ParameterSpec::boolean("second_hypotheses"),
  };
}
// clang-format on

}  // namespace slambed::cloudslam
