// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/ids.hpp"

namespace slambed {

struct PlayerOptions {
  NodeRole role = NodeRole::kMobile;
  std::filesystem::path config;      ///< run.json
  std::vector<std::string> command;  ///< the system's own program and its arguments
  std::string directory;             ///< where it starts; empty: here
  bool client = true;                ///< it speaks the client's protocol
  /// Without a client: the TUM file that it leaves in its output folder.
  std::string trajectory;
};

/// A node whose system is a program of somebody else: offers it frames on the run's clock, takes
/// its poses, and keeps the file contract of every node (docs/reference/run-folder.md).
/// Returns the exit code; throws Error for what is wrong on our side.
int play(const PlayerOptions& options);

}  // namespace slambed
