// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "node/policy.hpp"
#include "offload/downlink/map_downlink.hpp"
#include "offload/edge/edge_mapping.hpp"

namespace slambed {

/// Returns a system with Edge-SLAM's channels, ORB and tracking options, still without policies.
/// parameters: those of params.yaml and the system's own.
System offload_system(std::string name, std::vector<ParameterSpec> parameters);

DownlinkOptions downlink_options(const Parameters& parameters, const MessageCodec& codec);
EdgeMappingOptions mapping_options(const Parameters& parameters, const MessageCodec& codec);
/// Path of the stored map that the edge starts with and the mobile relocalizes in. Empty if none is
/// set or the system has no such parameter.
std::string edge_prior_map(const Parameters& parameters);

}  // namespace slambed
