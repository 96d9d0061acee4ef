// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "runtime/runtime.hpp"

namespace slambed {

/// What else runs on a device, as DeviceModel::background says it: workers that compute for
/// nothing, a little in every period, until the run stops. `cores` of the device, of which one is
/// `share` of a CPU of this host.
void spawn_background_load(Runtime& runtime, double cores, double share);

}  // namespace slambed
