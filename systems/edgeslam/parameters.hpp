// SPDX-License-Identifier: Apache-2.0
// Written from system.yaml by 'python -m slambed.document': change that file.
#pragma once

#include "node/parameters.hpp"

namespace slambed::edgeslam {

// clang-format off
inline std::vector<ParameterSpec> parameter_specs() {
  return {
      ParameterSpec::choice("reference_fallback", {"descriptors", "words"}),
      ParameterSpec::choice("point_identity", {"observations", "tracker_ids"}),
      ParameterSpec::choice("last_frame_points", {"own", "by_rank"}),
      ParameterSpec::choice("reference_after_update", {"known", "newest"}),
      ParameterSpec::boolean("reanchor_last"),
      ParameterSpec::boolean("local_observations"),
      ParameterSpec::choice("admission", {"on_arrival", "when_idle"}),
      ParameterSpec::choice("cull_age", {"mapped", "keyframe_ids"}),
      ParameterSpec::integer("local_map_size", 1, 100),
      ParameterSpec::integer("max_frames", 0, 1000),
      ParameterSpec::real("first_update_s", -1, 600),
      ParameterSpec::choice("update_poll", {"before_extraction", "after_extraction"}),
      ParameterSpec::path("prior_map"),
      ParameterSpec::integer("n_orb", 50, 10000),
      ParameterSpec::integer("n_kf", 1, 100),
      ParameterSpec::real("sync_period_s", 0, 600),
      ParameterSpec::choice("map_update", {"serial", "parallel", "parallel_waiting"}),
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

}  // namespace slambed::edgeslam
