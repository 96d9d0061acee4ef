// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "node/policy.hpp"

namespace slambed {

/// Returns every system that the programs offer.
std::vector<System> all_systems();

}  // namespace slambed
