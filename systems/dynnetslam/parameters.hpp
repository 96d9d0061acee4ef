// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::dynnetslam {

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {
  return {
      ParameterSpec::boolean("hysteresis"),
      ParameterSpec::boolean("safe_zone"),
      ParameterSpec::real("l_ol_ms", 0, 60000),
      ParameterSpec::real("l_sz_ms", -1, 60000),
      ParameterSpec::real("b_ms", 0, 60000),
      ParameterSpec::choice("rtt_source", {"tcp_info", "echo", "profile"}),
      ParameterSpec::real("mes_probe_hz", 0, 1000),
      ParameterSpec::integer("mes_probe_bytes", 0, 65536),
      ParameterSpec::real("echo_hz", 0.5, 100),
      ParameterSpec::real("rtt_missing_s", 0.1, 60),
      ParameterSpec::real("decision_gap_s", 0, 60),
      ParameterSpec::integer("n_orb", 50, 10000),
      ParameterSpec::integer("n_kf", 1, 100),
      ParameterSpec::real("sync_period_s", 0, 600),
      ParameterSpec::choice("map_update", {"serial", "parallel"}),
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

}  // namespace slambed::dynnetslam
