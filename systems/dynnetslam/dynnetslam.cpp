// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/dynnetslam.hpp"

#include "dynnetslam/policies.hpp"

namespace slambed {

System dynnetslam_system() {
  System system = offload_system("dynnetslam");
  system.channels.push_back("handover");
  system.sensors = {SensorKind::kRgbd, SensorKind::kMono};
  const std::vector<ParameterSpec> own = {
      ParameterSpec::boolean("hysteresis"),
      ParameterSpec::boolean("safe_zone"),
      ParameterSpec::real("l_ol_ms", 0, 60'000),
      ParameterSpec::real("l_sz_ms", -1, 60'000),
      ParameterSpec::real("b_ms", 0, 60'000),
      ParameterSpec::choice("rtt_source", {"tcp_info", "echo", "profile"}),
      ParameterSpec::real("mes_probe_hz", 0, 1000),
      ParameterSpec::integer("mes_probe_bytes", 0, 65'536),
      ParameterSpec::real("echo_hz", 0.5, 100),
      ParameterSpec::real("rtt_missing_s", 0.1, 60),
      ParameterSpec::real("decision_gap_s", 0, 60),
  };
  system.parameters.insert(system.parameters.end(), own.begin(), own.end());
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<dynnetslam::DynNetSlamMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<dynnetslam::DynNetSlamEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
