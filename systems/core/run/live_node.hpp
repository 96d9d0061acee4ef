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

/// Runs one node from its configuration to node.json (docs/reference/run-folder.md, "Life of a
/// node"), with threads, TCP and the monotonic clock. Throws Error with the exit code of the
/// process.
void run_live_node(const LiveNodeOptions& options, std::span<const System> systems);

}  // namespace slambed
