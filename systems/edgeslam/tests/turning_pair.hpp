// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <numbers>

#include "node/tests/virtual_pair.hpp"

namespace slambed::testing {

inline nlohmann::json conventional() {
  return {{"n_orb", 1000},
          {"n_kf", 6},
          {"sync_period_s", 5.0},
          {"map_update", "serial"},
          {"update_neighbours", 0},
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
          {"loop_closing", true}};
}

inline nlohmann::json enhanced() {
  auto params = conventional();
  params.update(
      {{"n_kf", 1}, {"n_orb", 750}, {"map_update", "parallel"}, {"min_local_keyframes", 1}});
  return params;
}

inline SE3 pose_at(int frame) {
  const double yaw = 2.5 * frame * std::numbers::pi / 180;
  const Eigen::Vector3d centre(0.5 * std::sin(yaw), 0.1 * std::sin(3 * yaw), -0.5 * std::cos(yaw));
  const Eigen::Matrix3d R_wc = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return SE3(R_wc, centre).inverse();
}

/// Looking round the room, 25 degrees per second at 10 frames per second: there is always something
/// new to make keyframes of.
inline std::shared_ptr<const FeatureSet> turn(SyntheticWorld& world, int frame) {
  return world.look(pose_at(frame));
}

}  // namespace slambed::testing
