// SPDX-License-Identifier: Apache-2.0
// slambed-sim: a whole run in virtual time. See docs/formats.md for its files and exit codes.
#include <CLI/CLI.hpp>
#include <iostream>

#include "node/node_files.hpp"
#include "node/virtual_run.hpp"
#include "programs/program.hpp"
#include "programs/systems.hpp"

namespace slambed {
namespace {

int simulate(int argc, char** argv) {
  CLI::App app(
      "Both nodes of a slambed run in virtual time: reads sim.json, leaves the files that "
      "live nodes leave. Equal inputs give equal bytes.");
  app.name("slambed-sim");
  app.set_version_flag("--version", std::string("slambed-sim ") + version());
  std::filesystem::path config;
  app.add_option("--config", config, "path of sim.json")->required();
  if (const auto code = parse(app, argc, argv)) return *code;
  run_virtually(config, all_systems());
  return 0;
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::simulate(argc, argv); });
}
