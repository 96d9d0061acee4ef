// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "node/policy.hpp"
#include "offload/edge_mapping.hpp"
#include "offload/map_downlink.hpp"
#include "offload/relocalisation.hpp"

namespace slambed {

/// What every system with Edge-SLAM's offloading has alike: parameters (documented in each
/// system.yaml), channels and options made of them.
std::vector<ParameterSpec> offload_parameters();

/// A system with these parameters and channels, ORB and tracking options; policies are missing.
System offload_system(std::string name);

/// The channels of Edge-SLAM, with its drop-oldest queues on both sides.
struct OffloadChannels {
  OffloadChannels(Network& network, const Parameters& parameters);
  Channel &control, &keyframe, &map, &frame;
};

MapDownlink::Mode downlink_mode(const Parameters& parameters);
UpdateRules update_rules(const Parameters& parameters);
EdgeMappingOptions mapping_options(const Parameters& parameters);
RelocalisationOptions relocalisation_options(const Parameters& parameters);
Duration relocalisation_period(const Parameters& parameters);

}  // namespace slambed
