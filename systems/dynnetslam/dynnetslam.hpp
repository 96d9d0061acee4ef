// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// DynNetSLAM: tracking on the mobile node, mapping where the RTT decides. The variants of
/// system.yaml are the paper's four strategies.
System dynnetslam_system();

}  // namespace slambed
