// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// The smallest system worth writing: Edge-SLAM that makes no keyframe while the link or the mapper
/// is busy with earlier ones. docs/how-to/write-a-system-in-cpp.md walks through it.
System example_backpressure_system();

}  // namespace slambed
