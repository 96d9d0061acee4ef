// SPDX-License-Identifier: Apache-2.0
#include "edgeslam/edgeslam.hpp"

#include "offload/edge_slam.hpp"
#include "offload/original_behaviour.hpp"

namespace slambed {

System edgeslam_system() {
  auto specs = offload_parameters({"serial", "parallel", "parallel_waiting"});
  for (ParameterSpec& one : original_parameters()) specs.push_back(std::move(one));
  System system = offload_system("edgeslam", std::move(specs));
  system.sensors = {SensorKind::kRgbd, SensorKind::kStereo, SensorKind::kMono};
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
