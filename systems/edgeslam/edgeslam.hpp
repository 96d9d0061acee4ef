// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// Edge-SLAM: tracking on the mobile node, mapping on the edge, map updates back. The variants of
/// system.yaml differ in parameters only.
System edgeslam_system();

}  // namespace slambed
