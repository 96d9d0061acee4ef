// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "runtime/cost_model.hpp"

namespace slambed {

/// A cost model as the harness writes it (docs/reference/run-folder.md). where: full name of the
/// object, for messages. bad_input for anything missing, wrong or unknown.
DeviceModel read_device(const nlohmann::json& json, const std::string& where);

}  // namespace slambed
