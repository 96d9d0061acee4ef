// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "node/policy.hpp"
#include "offload/downlink/map_downlink.hpp"
#include "offload/edge/edge_mapping.hpp"

namespace slambed {

/// A system with Edge-SLAM's offloading: its channels, ORB and tracking options. The parameters are
/// those of params.yaml and its own; policies are missing.
System offload_system(std::string name, std::vector<ParameterSpec> parameters);

DownlinkOptions downlink_options(const Parameters& parameters, const MessageCodec& codec);
EdgeMappingOptions mapping_options(const Parameters& parameters, const MessageCodec& codec);
/// The stored map that the edge begins with and the mobile is to be found in; empty: none, also
/// where the system has no such parameter.
std::string edge_prior_map(const Parameters& parameters);

}  // namespace slambed
