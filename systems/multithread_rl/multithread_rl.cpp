// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/multithread_rl.hpp"

#include "multithread_rl/parameters.hpp"
#include "offload/edge_slam.hpp"

namespace slambed {
System multithread_rl_system() {
  System system = offload_system("multithread_rl", multithread_rl::parameter_specs());
  system.sensors = {SensorKind::kRgbd, SensorKind::kStereo};
  system.tracker = [usual = system.tracker](const Parameters& parameters) {
    TrackerOptions options = usual(parameters);
    options.follow_recovery =
        parameters.text("relocalisation") == "edge" && parameters.boolean("keep_recovery_keyframe");
    return options;
  };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
