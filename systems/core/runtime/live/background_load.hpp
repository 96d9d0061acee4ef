// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/runtime.hpp"

namespace slambed {

/// Spawns workers that burn CPU time in every period until the run stops, to imitate
/// DeviceModel::background. cores: cores of the device, one of which is `share` of a CPU of this
/// host.
void spawn_background_load(Runtime& runtime, double cores, double share);

}  // namespace slambed
