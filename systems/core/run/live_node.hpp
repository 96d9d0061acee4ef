// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include "base/ids.hpp"
#include "node/policy.hpp"

namespace slambed {

struct LiveNodeOptions {
  NodeRole role = NodeRole::kMobile;
  std::filesystem::path config;
  bool verify = false;  ///< check every frame of the sequence first
};

/// One node from its configuration to node.json (docs/reference/run-folder.md), on threads,
/// TCP and the monotonic clock. Throws Error with the exit code to end with.
void run_live_node(const LiveNodeOptions& options, std::span<const System> systems);

}  // namespace slambed
