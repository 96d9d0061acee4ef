// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// ORB-SLAM2 with everything on the mobile node: tracking and mapping, each on its worker.
System orbslam2_system();

}  // namespace slambed
