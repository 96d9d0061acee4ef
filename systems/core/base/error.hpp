// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace slambed {

/// Exit codes of every slambed program (docs/reference/exit-codes.md).
enum class ExitCode : int {
  kOk = 0,
  kBadInput = 2,     ///< a file, option or value is wrong; the user can fix it
  kEnvironment = 3,  ///< a privilege, port, device or file system is not available
  kPeer = 4,         ///< the other node never connected or left before the start
  kInternal = 70,    ///< a bug in slambed
};

/// The only exception type that programs report. Its message is one line that says what went
/// wrong, where, and what to do.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& line) : std::runtime_error(line), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

inline Error bad_input(const std::string& line) { return {ExitCode::kBadInput, line}; }
inline Error environment_error(const std::string& line) { return {ExitCode::kEnvironment, line}; }

}  // namespace slambed
