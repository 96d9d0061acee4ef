// SPDX-License-Identifier: Apache-2.0
#include "edgeslam/edgeslam.hpp"

#include <algorithm>

#include "edgeslam/policies.hpp"

namespace slambed {

System edgeslam_system() {
  System system;
  system.name = "edgeslam";
  system.channels = {"control", "keyframe", "map", "frame"};
  system.parameters = {
      ParameterSpec::integer("n_orb", 50, 10'000),
      ParameterSpec::integer("n_kf", 1, 100),
      ParameterSpec::real("sync_period_s", 0, 600),
      ParameterSpec::choice("map_update", {"serial", "parallel"}),
      ParameterSpec::integer("update_neighbours", 0, 100),
      ParameterSpec::integer("min_local_keyframes", 0, 100),
      ParameterSpec::real("fast_motion_ms", 0, 10'000),
      ParameterSpec::integer("keyframe_queue", 1, 1000),
      ParameterSpec::integer("edge_queue", 1, 1000),
      ParameterSpec::boolean("update_poses"),
      ParameterSpec::boolean("final_poses"),
      ParameterSpec::real("reloc_request_ms", 0, 60'000),
      ParameterSpec::real("reloc_map_period_s", 0, 600),
      ParameterSpec::integer("reloc_candidates", 1, 100),
      ParameterSpec::integer("reloc_covisibles", 0, 100),
  };
  system.orb = [](const Parameters& parameters) {
    OrbOptions options;
    options.features = parameters.integer("n_orb");
    return options;
  };
  system.tracker = [](const Parameters& parameters) {
    TrackerOptions options;
    options.min_init_features = std::min(500, parameters.integer("n_orb") / 2);
    // The local map is small by design: being lost in it is a case for relocalisation.
    options.reset_below_keyframes = 0;
    return options;
  };
  system.sequential = [](const Parameters&) { return false; };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
