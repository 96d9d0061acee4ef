// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include "node/policy.hpp"

namespace slambed {

/// Both nodes of a run in one process, in virtual time: the same node and system code as live, with
/// modeled compute cost and a modeled link. Leaves the files that two live nodes leave, and
/// samples.jsonl. Equal inputs give equal bytes. Throws Error with the exit code to end with.
void run_virtually(const std::filesystem::path& sim_config, std::span<const System> systems);

}  // namespace slambed
