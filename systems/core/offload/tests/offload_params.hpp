// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

namespace slambed::testing {

/// All offloading parameters with the values of conventional Edge-SLAM.
inline nlohmann::json conventional() {
  return {{"n_orb", 1000},
          {"n_kf", 6},
          {"sync_period_s", 5.0},
          {"map_update", "serial"},
          {"update_neighbors", 0},
          {"min_local_keyframes", 6},
          {"fast_motion_ms", 300.0},
          {"decline_kf_rate_hz", 0.0},
          {"codec", "binary"},
          {"keyframe_queue", 2},
          {"edge_queue", 3},
          {"update_poses", true},
          {"final_poses", true},
          {"reloc_request_ms", 500.0},
          {"reloc_map_period_s", 1.0},
          {"reloc_candidates", 5},
          {"reloc_covisibles", 2},
          {"loop_closing", true},
          {"second_hypotheses", false}};
}

/// Parameters that only edgeslam has: the switches of original_behavior.hpp with our defaults, and
/// no prior map.
inline nlohmann::json ours() {
  return {{"reference_fallback", "descriptors"},
          {"point_identity", "observations"},
          {"last_frame_points", "own"},
          {"reference_after_update", "known"},
          {"reanchor_last", true},
          {"local_observations", true},
          {"admission", "on_arrival"},
          {"cull_age", "mapped"},
          {"local_map_size", 6},
          {"max_frames", 0},
          {"first_update_s", -1.0},
          {"update_poll", "before_extraction"},
          {"prior_map", ""}};
}

inline nlohmann::json enhanced() {
  auto params = conventional();
  params.update(
      {{"n_kf", 1}, {"n_orb", 750}, {"map_update", "parallel"}, {"min_local_keyframes", 1}});
  return params;
}

}  // namespace slambed::testing
