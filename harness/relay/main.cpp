// SPDX-License-Identifier: Apache-2.0
/// slambed-relay: the emulated network between two namespaces (docs/link.md).
#include <signal.h>

#include <CLI/CLI.hpp>
#include <iostream>

#include "base/error.hpp"
#include "relay.hpp"

namespace {

using slambed::Error;
using slambed::ExitCode;

void block_stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGINT);
  sigprocmask(SIG_BLOCK, &set, nullptr);
}

int serve(const std::string& config) {
  const auto options = slambed::relay::read_config(config);
  block_stop_signals();
  slambed::relay::Relay relay(options);
  relay.run();
  relay.write_summary();
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The emulated network between a mobile and an edge namespace");
  std::string config;
  app.add_option("--config", config, "relay configuration (JSON)")->required();
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::cerr << "error: " << error.what() << ", command line, see --help\n";
    return static_cast<int>(ExitCode::kBadInput);
  }
  try {
    return serve(config);
  } catch (const Error& error) {
    std::cerr << "error: " << error.what() << '\n';
    return static_cast<int>(error.code());
  } catch (const std::exception& error) {
    std::cerr << "error: internal failure, " << error.what() << ", please report it\n";
    return static_cast<int>(ExitCode::kInternal);
  }
}
