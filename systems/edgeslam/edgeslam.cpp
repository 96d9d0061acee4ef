// SPDX-License-Identifier: Apache-2.0
#include "edgeslam/edgeslam.hpp"

#include "edgeslam/parameters.hpp"
#include "edgeslam/policies.hpp"
#include "offload/nodes/settings.hpp"

namespace slambed {

System edgeslam_system() {
  System system = offload_system("edgeslam", edgeslam::parameter_specs());
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
