// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/cloudslam.hpp"

#include <algorithm>
#include <array>

#include "cloudslam/parameters.hpp"
#include "cloudslam/policies.hpp"
#include "node/tracking_options.hpp"

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
  RemoteMapperOptions mapper;
  mapper.place_candidates = parameters.integer("place_candidates");
  mapper.near_candidates = parameters.integer("near_candidates");
  mapper.search_radius_m = parameters.real("search_radius_m");
  return {.prior_map = parameters.text("prior_map"),
          .queue = parameters.integer("remote_queue"),
          .mapper = mapper,
          .codec = message_codec(parameters)};
}

LocalMapperOptions mapper_options(const Parameters& parameters) {
  LocalMapperOptions options;
  const auto most = static_cast<std::size_t>(parameters.integer("bundle_keyframes"));
  if (most > 0) options.bundle_size = {.moving = most, .fixed = most};
  return options;
}

}  // namespace cloudslam

System cloudslam_system() {
  System system;
  system.name = "cloudslam";
  system.sensors = {SensorKind::kStereo, SensorKind::kRgbd};
  system.channels = {"control", "keyframe", "upload"};
  system.parameters = cloudslam::parameter_specs();
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
