// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "multithread_rl/multithread_rl.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed::testing {

constexpr int kDark = 80, kDarkFor = 6, kLostTurnFrames = 120;

/// A local map of one keyframe, so that only the global map reaches back.
inline nlohmann::json lost_turn_params(const std::string& map_update,
                                       const std::string& codec = "binary") {
  auto all = conventional();
  all.update({{"map_update", map_update},
              {"keyframe_backup", "update"},
              {"prior_map", ""},
              {"relocalization", "edge"},
              {"keep_recovery_keyframe", true},
              {"reloc_fail_bytes", 75'000},
              {"codec", codec},
              {"n_kf", 1},
              {"sync_period_s", 1.0},
              {"fast_motion_ms", 0.0},
              {"min_local_keyframes", 1}});
  return all;
}

/// Frame of the turn that the camera sees after the darkness: from second one on at half speed, so
/// that it stays away from the place where it was lost.
inline double far_back_at(int frame) { return 10 + 0.5 * (frame - kDark - kDarkFor); }

/// Darkness, then a place that only the edge's map has.
inline std::shared_ptr<const FeatureSet> far_back(SyntheticScene& scene, int frame) {
  if (frame < kDark) return turn(scene, frame);
  return frame < kDark + kDarkFor ? scene.nothing() : scene.look(pose_at(far_back_at(frame)));
}

/// Darkness, then the last place again.
inline std::shared_ptr<const FeatureSet> same_place(SyntheticScene& scene, int frame) {
  if (frame >= kDark && frame < kDark + kDarkFor) return scene.nothing();
  return turn(scene, frame < kDark ? frame : frame - kDarkFor);
}

inline PairResult lost_turn(const nlohmann::json& params, const PairLink& link,
                            SceneSource::Look look = far_back, int frames = kLostTurnFrames) {
  return run_pair(multithread_rl_system(), params, frames, 10, link, std::move(look));
}

}  // namespace slambed::testing
