// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/multithread_rl.hpp"

#include "offload/edge_slam.hpp"

namespace slambed {
namespace {

std::vector<ParameterSpec> parameters() {
  auto all = offload_parameters({"serial", "staged"});
  for (auto& own : {staging_parameters(), edge_relocalisation_parameters()})
    all.insert(all.end(), own.begin(), own.end());
  return all;
}

}  // namespace

System multithread_rl_system() {
  System system = offload_system("multithread_rl", parameters());
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
