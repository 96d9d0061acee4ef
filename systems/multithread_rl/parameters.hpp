// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::multithread_rl {

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {
  return {
      ParameterSpec::choice("relocalization", {"map", "edge"}),
      ParameterSpec::boolean("keep_recovery_keyframe"),
      ParameterSpec::integer("reloc_fail_bytes", 0, 10000000),
      ParameterSpec::choice("keyframe_backup", {"none", "update", "uncovered"}),
      ParameterSpec::path("prior_map"),
      ParameterSpec::integer("n_orb", 50, 10000),
      ParameterSpec::integer("n_kf", 1, 100),
      ParameterSpec::real("sync_period_s", 0, 600),
      ParameterSpec::choice("map_update", {"serial", "staged"}),
      ParameterSpec::integer("update_neighbors", 0, 100),
      ParameterSpec::integer("min_local_keyframes", 0, 100),
      ParameterSpec::real("fast_motion_ms", 0, 10000),
      ParameterSpec::real("decline_kf_rate_hz", 0, 1000),
      ParameterSpec::choice("codec", {"binary", "compatibility"}),
      ParameterSpec::integer("keyframe_queue", 1, 1000),
      ParameterSpec::integer("edge_queue", 1, 1000),
      ParameterSpec::boolean("update_poses"),
      ParameterSpec::boolean("final_poses"),
      ParameterSpec::boolean("loop_closing"),
      ParameterSpec::boolean("second_hypotheses"),
      ParameterSpec::real("reloc_request_ms", 0, 60000),
      ParameterSpec::real("reloc_map_period_s", 0, 600),
      ParameterSpec::integer("reloc_candidates", 1, 100),
      ParameterSpec::integer("reloc_covisibles", 0, 100),
  };
}
// clang-format on

}  // namespace slambed::multithread_rl
