// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include "node/policy.hpp"

namespace slambed {

/// Runs both nodes in one process in virtual time, with the same node and system code as live runs
/// but modeled compute cost and a modeled link. Writes the files of two live nodes and
/// samples.jsonl. Equal inputs give equal bytes. Throws Error with the exit code of the process.
void run_virtually(const std::filesystem::path& sim_config, std::span<const System> systems);

}  // namespace slambed
