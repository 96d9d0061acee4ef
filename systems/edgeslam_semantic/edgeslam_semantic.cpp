// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/edgeslam_semantic.hpp"

#include "edgeslam_semantic/full_offload.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "edgeslam_semantic/parameters.hpp"
#include "edgeslam_semantic/partial_offload.hpp"
#include "edgeslam_semantic/semantic_edge.hpp"
#include "node/tracking_options.hpp"

namespace slambed {

System edgeslam_semantic_system() {
  System system;
  system.name = "edgeslam_semantic";
  system.channels = {"control", "frame", "mask", "probe"};
  system.messages = {edgeslam_semantic::kMessages};
  system.sensors = {SensorKind::kMono};
  system.parameters = edgeslam_semantic::parameter_specs();
  system.orb = orb_options;
  system.tracker = [](const Parameters& parameters) { return tracker_options(parameters); };
  system.sequential = [](const Parameters&) { return false; };
  system.jpeg_quality = [](const Parameters& parameters) {
    return parameters.integer("jpeg_quality");
  };
  system.extracts_on_edge = [](const Parameters& parameters) {
    return parameters.boolean("full_offload");
  };
  system.orb_levels = [](const Parameters& parameters) {
    const bool adapts = !parameters.boolean("full_offload") && parameters.boolean("adapt");
    return adapts ? std::vector<int>{8, 6, 4} : std::vector<int>{8};
  };
  system.mobile = [](MobileNode& node,
                     const Parameters& parameters) -> std::unique_ptr<MobilePolicy> {
    if (parameters.boolean("full_offload"))
      return std::make_unique<edgeslam_semantic::OffloadedMobile>(node, parameters);
    return std::make_unique<edgeslam_semantic::SemanticMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) -> std::unique_ptr<EdgePolicy> {
    if (parameters.boolean("full_offload"))
      return std::make_unique<edgeslam_semantic::OffloadedEdge>(node, parameters,
                                                                tracker_options(parameters));
    return std::make_unique<edgeslam_semantic::SemanticEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
