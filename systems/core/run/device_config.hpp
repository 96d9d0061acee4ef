// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "runtime/cost_model.hpp"

namespace slambed {

/// Reads a cost model as the harness writes it (docs/reference/run-folder.md, "Virtual run").
/// where: full name of the object, for messages. Throws bad_input for missing, invalid or unknown
/// keys.
DeviceModel read_device(const nlohmann::json& json, const std::string& where);

}  // namespace slambed
