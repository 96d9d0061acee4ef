// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/edgeslam_semantic.hpp"

#include "edgeslam_semantic/full_offload.hpp"
#include "edgeslam_semantic/partial_offload.hpp"
#include "edgeslam_semantic/semantic_edge.hpp"
#include "node/tracking_options.hpp"

namespace slambed {

System edgeslam_semantic_system() {
  System system;
  system.name = "edgeslam_semantic";
  system.channels = {"control", "frame", "mask", "probe"};
  system.sensors = {SensorKind::kMono};
  system.parameters = {
      ParameterSpec::integer("n_orb", 50, 10'000),
      ParameterSpec::integer("jpeg_quality", 1, 100),
      ParameterSpec::integer("offload_window", 0, 1000),
      ParameterSpec::boolean("nrcc"),
      ParameterSpec::real("n_m", 0, 1),
      ParameterSpec::integer("mask_border_px", 0, 100),
      ParameterSpec::real("nrcc_floor_ms", 0, 10'000),
      ParameterSpec::boolean("loop_closing"),
      ParameterSpec::boolean("second_hypotheses"),
      ParameterSpec::boolean("full_offload"),
      ParameterSpec::boolean("adapt"),
      ParameterSpec::integer("fixed_row", 0, 5),
      ParameterSpec::boolean("delay_one_way"),
      ParameterSpec::real("probe_period_s", 0.01, 60),
      ParameterSpec::integer("keyframes_under_way", 0, 1000),
      ParameterSpec::boolean("local_references"),
      ParameterSpec::integer("local_keyframes", 2, 1000),
      ParameterSpec::integer("local_neighbours", 1, 100),
      ParameterSpec::choice("table_n_m", {"0.8 0.7 0.6"}),
      ParameterSpec::integer("label_frames", 1, 10'000),
      ParameterSpec::integer("label_neighbours", 0, 100),
      ParameterSpec::real("label_reach_px", 1, 1000),
  };
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
