// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "runtime/live/socket.hpp"

namespace slambed {

/// What a system's command is started with.
struct CommandOptions {
  std::vector<std::string> arguments;
  std::string directory;                                         ///< empty: where we are
  std::vector<std::pair<std::string, std::string>> environment;  ///< besides ours
  std::vector<int> inherited;                                    ///< descriptors that it gets
};

/// The system's own program, a child of the player: it ends with the player, however that dies,
/// and what it started ends with it.
class Command {
 public:
  /// bad_input when it cannot be started. Call it on the main thread: the kernel ends the child
  /// with the thread that made it.
  explicit Command(const CommandOptions& options);
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  /// Waits up to that long; the exit code as shells tell it (128 + number of a signal).
  std::optional<int> wait(Duration patience);
  /// SIGTERM to all of it, and SIGKILL to what is left after two seconds. Returns the exit code.
  int end();

 private:
  pid_t pid_ = -1;
  FileDescriptor watch_;
  std::optional<int> code_;
};

}  // namespace slambed
