// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "cloudslam/remote_mapping.hpp"
#include "cloudslam/strategy.hpp"
#include "node/policy.hpp"
#include "slam/local_mapper.hpp"

namespace slambed {

/// CloudSLAM: tracking and mapping on the vehicle, poses from an edge that has the map of earlier
/// trips. The variants of system.yaml differ in parameters only.
System cloudslam_system();

namespace cloudslam {

StrategyOptions strategy_options(const Parameters& parameters);
RemoteMappingOptions remote_mapping_options(const Parameters& parameters);
/// Of the vehicle's own mapping.
LocalMapperOptions mapper_options(const Parameters& parameters);

}  // namespace cloudslam
}  // namespace slambed
