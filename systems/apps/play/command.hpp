// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "runtime/live/socket.hpp"

namespace slambed {

struct CommandOptions {
  std::vector<std::string> arguments;
  std::string directory;  ///< working directory; empty: the player's
  std::vector<std::pair<std::string, std::string>> environment;  ///< added to the player's
  std::vector<int> inherited;  ///< file descriptors that the command inherits
};

/// The system's own program as a child of the player. It dies with the player, even if the player
/// is killed, and its process group dies with it.
class Command {
 public:
  /// Throws bad_input if the command cannot be started. Call it on the main thread: the kernel
  /// kills the child when the thread that forked it ends (PR_SET_PDEATHSIG).
  explicit Command(const CommandOptions& options);
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  /// Waits up to `patience` for the end. Returns the exit code as a shell does (128 + signal), or
  /// nothing if it still runs.
  std::optional<int> wait(Duration patience);
  /// Sends SIGTERM to the process group, and SIGKILL after two seconds. Returns the exit code.
  int end();

 private:
  pid_t pid_ = -1;
  FileDescriptor watch_;
  std::optional<int> code_;
};

}  // namespace slambed
