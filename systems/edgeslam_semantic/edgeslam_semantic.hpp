// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// Semantic edgeSLAM (INFOCOM 2020), and the two systems that it is compared with: ORB-SLAM and
/// Mask-SLAM with everything on the edge.
System edgeslam_semantic_system();

}  // namespace slambed
