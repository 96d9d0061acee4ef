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
  std::string directory;             ///< its working directory; empty: the player's
  bool client = true;                ///< the program speaks the client protocol
  /// Without a client: name of the TUM file that the program leaves in its output folder.
  std::string trajectory;
};

/// Runs a node whose system is an external program: offers it frames on the run's clock, takes its
/// poses, and leaves the files of every node (docs/reference/run-folder.md, "Life of a node").
/// Returns the exit code. Throws Error for a bad configuration, a bad message or a failure of the
/// environment.
int play(const PlayerOptions& options);

}  // namespace slambed
