// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// Semantic edgeSLAM (INFOCOM 2020) and its two baselines: ORB-SLAM and Mask-SLAM, fully offloaded
/// to the edge.
System edgeslam_semantic_system();

}  // namespace slambed
