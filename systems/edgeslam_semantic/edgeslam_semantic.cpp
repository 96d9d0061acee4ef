// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/edgeslam_semantic.hpp"

#include "edgeslam_semantic/full_offload.hpp"
#include "node/tracking_options.hpp"

namespace slambed {

System edgeslam_semantic_system() {
  System system;
  system.name = "edgeslam_semantic";
  system.channels = {"control", "frame"};
  system.sensors = {SensorKind::kMono};
  system.parameters = {
      ParameterSpec::integer("n_orb", 50, 10'000),  ParameterSpec::integer("jpeg_quality", 1, 100),
      ParameterSpec::integer("offload_window", 0, 1000), ParameterSpec::boolean("nrcc"),
      ParameterSpec::real("n_m", 0, 1),             ParameterSpec::integer("mask_border_px", 0, 100),
      ParameterSpec::boolean("loop_closing"),       ParameterSpec::boolean("second_hypotheses"),
  };
  system.orb = orb_options;
  system.tracker = [](const Parameters& parameters) { return tracker_options(parameters); };
  system.sequential = [](const Parameters&) { return false; };
  system.jpeg_quality = [](const Parameters& parameters) {
    return parameters.integer("jpeg_quality");
  };
  system.extracts_on_edge = [](const Parameters&) { return true; };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<edgeslam_semantic::OffloadedMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<edgeslam_semantic::OffloadedEdge>(node, parameters,
                                                              tracker_options(parameters));
  };
  return system;
}

}  // namespace slambed
