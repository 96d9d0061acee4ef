// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/cloudslam.hpp"

#include <algorithm>
#include <array>

#include "cloudslam/policies.hpp"
#include "node/tracking_options.hpp"
#include "offload/settings.hpp"

namespace slambed {
namespace cloudslam {
namespace {

/// In the order of StrategyKind.
const std::vector<std::string> kStrategies{"all", "periodic", "distance", "adaptive", "none"};

}  // namespace

StrategyOptions strategy_options(const Parameters& parameters) {
  const auto chosen =
      std::find(kStrategies.begin(), kStrategies.end(), parameters.text("strategy"));
  return {.kind = static_cast<StrategyKind>(chosen - kStrategies.begin()),
          .period_s = parameters.real("period_s"),
          .distance_m = parameters.real("distance_m"),
          .correction_threshold_m = parameters.real("correction_threshold_m"),
          .decrease = parameters.real("decrease"),
          .increase = parameters.real("increase"),
          .distance_min_m = parameters.real("distance_min_m"),
          .distance_max_m = parameters.real("distance_max_m")};
}

RemoteMappingOptions remote_mapping_options(const Parameters& parameters) {
  RemoteMappingOptions options;
  options.prior_map = parameters.text("prior_map");
  options.queue = parameters.integer("remote_queue");
  options.mapper.place_candidates = parameters.integer("place_candidates");
  options.mapper.near_candidates = parameters.integer("near_candidates");
  options.mapper.search_radius_m = parameters.real("search_radius_m");
  options.codec = message_codec(parameters);
  return options;
}

}  // namespace cloudslam

System cloudslam_system() {
  System system;
  system.name = "cloudslam";
  system.sensors = {SensorKind::kStereo, SensorKind::kRgbd};
  system.channels = {"control", "keyframe", "upload"};
  system.parameters = {
      ParameterSpec::integer("n_orb", 50, 10'000),
      ParameterSpec::choice("strategy", cloudslam::kStrategies),
      ParameterSpec::real("period_s", 0, 600),
      ParameterSpec::real("distance_m", 0, 10'000),
      ParameterSpec::real("correction_threshold_m", 0, 1000),
      ParameterSpec::real("decrease", 0, 10),
      ParameterSpec::real("increase", 0, 10),
      ParameterSpec::real("distance_min_m", 0, 10'000),
      ParameterSpec::real("distance_max_m", 0, 10'000),
      ParameterSpec::real("window_s", 0, 600),
      ParameterSpec::choice("back_propagation", {"graded", "rigid"}),
      ParameterSpec::real("align_rate_hz", 0.1, 100),
      ParameterSpec::real("align_timeout_s", 0, 600),
      ParameterSpec::path("prior_map"),
      ParameterSpec::real("search_radius_m", 0, 10'000),
      ParameterSpec::integer("place_candidates", 0, 100),
      ParameterSpec::integer("near_candidates", 0, 100),
      ParameterSpec::integer("remote_queue", 1, 1000),
      ParameterSpec::integer("keyframe_queue", 1, 1000),
      ParameterSpec::integer("keyframe_bytes", 0, 50'000'000),
      ParameterSpec::choice("codec", {"binary", "compatibility"}),
      ParameterSpec::boolean("upload"),
      ParameterSpec::boolean("second_hypotheses"),
  };
  system.orb = orb_options;
  system.tracker = [](const Parameters& parameters) { return tracker_options(parameters); };
  system.sequential = [](const Parameters&) { return false; };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<cloudslam::Vehicle>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<cloudslam::Edge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
