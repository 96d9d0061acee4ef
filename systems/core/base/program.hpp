// SPDX-License-Identifier: Apache-2.0
/// Command-line parsing and error reports of every program. Only main files include this header,
/// because only programs link CLI11.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <iostream>
#include <optional>
#include <string>

#include "base/error.hpp"

namespace slambed {

/// Prints the error line for the user and returns the exit code.
inline int fail(ExitCode code, const std::string& line) {
  std::cerr << "error: " << line << std::endl;
  return static_cast<int>(code);
}

/// Parses the command line. Returns an exit code when the program must end now (help or an error).
inline std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::Success& wanted) {
    return app.exit(wanted);
  } catch (const CLI::ParseError& error) {
    return fail(ExitCode::kBadInput,
                std::string(error.what()) + "; see " + app.get_name() + " --help");
  }
}

/// Runs a program's body; every exception becomes one line and a documented exit code.
inline int run_program(const std::function<int()>& body) {
  try {
    return body();
  } catch (const Error& error) {
    return fail(error.code(), error.what());
  } catch (const std::exception& error) {
    return fail(ExitCode::kInternal,
                std::string(error.what()) + "; this is a bug of slambed, please report it");
  }
}

}  // namespace slambed
