// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "edgeslam/edgeslam.hpp"
#include "offload/tests/turning_pair.hpp"

/// Runs of edgeslam's two nodes: a variant's parameters with edgeslam's own switches added.
namespace slambed::testing::edgeslam {

inline nlohmann::json with_switches(nlohmann::json params) {
  params.update(ours());
  return params;
}
inline nlohmann::json conventional() { return with_switches(testing::conventional()); }
inline nlohmann::json enhanced() { return with_switches(testing::enhanced()); }

inline PairResult run_over(const PairLink& link, const nlohmann::json& params, int frames = 160) {
  return run_pair(edgeslam_system(), params, frames, 10, link, turn);
}

inline PairResult run(const nlohmann::json& params, int frames = 160, double one_way_ms = 0.1,
                      SceneSource::Look look = turn) {
  return run_pair(edgeslam_system(), params, frames, 10, {.one_way_ms = {one_way_ms}},
                  std::move(look));
}

}  // namespace slambed::testing::edgeslam
