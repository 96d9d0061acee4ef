// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/dynnetslam.hpp"

#include "dynnetslam/mobile_policy.hpp"
#include "dynnetslam/parameters.hpp"
#include "offload/nodes/settings.hpp"

namespace slambed {

System dynnetslam_system() {
  System system = offload_system("dynnetslam", dynnetslam::parameter_specs());
  system.channels.push_back("handover");
  system.sensors = {SensorKind::kRgbd, SensorKind::kMono};
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<dynnetslam::DynNetSlamMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<SwitchedMappingEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
