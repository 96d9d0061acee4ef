// SPDX-License-Identifier: Apache-2.0
/// slambed-relay: the emulated network between two namespaces (docs/explanation/link.md).
#include <signal.h>

#include <CLI/CLI.hpp>

#include "apps/relay/relay.hpp"
#include "base/program.hpp"

namespace slambed::relay {
namespace {

void block_stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGINT);
  sigprocmask(SIG_BLOCK, &set, nullptr);
}

int serve(int argc, char** argv) {
  CLI::App app("The emulated network between a mobile and an edge namespace");
  app.name("slambed-relay");
  std::string config;
  app.add_option("--config", config, "relay configuration (JSON)")->required();
  if (const auto code = parse(app, argc, argv)) return *code;
  const auto options = read_config(config);
  block_stop_signals();
  Relay relay(options);
  relay.run();
  relay.finish();
  return 0;
}

}  // namespace
}  // namespace slambed::relay

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::relay::serve(argc, argv); });
}
