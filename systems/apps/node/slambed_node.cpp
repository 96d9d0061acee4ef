// SPDX-License-Identifier: Apache-2.0
// slambed-node: one node of a run. docs/reference/run-folder.md describes its files and exit codes.
#include <CLI/CLI.hpp>
#include <iostream>

#include "apps/registry/systems.hpp"
#include "base/program.hpp"
#include "run/live_node.hpp"
#include "run/node_files.hpp"
#include "wire/message_names.hpp"

namespace slambed {
namespace {

nlohmann::json describe(const System& system) {
  const wire::MessageNames all(system.messages);  // throws if message numbers collide
  auto own = nlohmann::json::object();
  for (const wire::MessageRange& range : system.messages) {
    for (std::size_t i = 0; i < range.count(); ++i) own[range.name(i)] = range.first() + i;
  }
  return {{"params", describe(system.parameters)},
          {"channels", system.channels},
          {"messages", std::move(own)}};
}

nlohmann::json describe_all(const std::vector<System>& systems) {
  auto all = nlohmann::json::object();
  for (const System& system : systems) all[system.name] = describe(system);
  return all;
}

int run(int argc, char** argv) {
  CLI::App app(
      "One node of a slambed run: reads run.json, waits for start.json, plays, and leaves "
      "events and trajectories in the output folder.");
  app.name("slambed-node");
  app.set_version_flag("--version", std::string("slambed-node ") + version());
  LiveNodeOptions options;
  std::string role;
  bool describe_only = false;
  auto* role_option =
      app.add_option("--role", role, "mobile or edge")->check(CLI::IsMember({"mobile", "edge"}));
  auto* config_option = app.add_option("--config", options.config, "path of run.json");
  app.add_flag("--verify", options.verify, "check every frame of the sequence before the run");
  app.add_flag("--describe", describe_only,
               "print the systems, their parameters and own messages as JSON");
  if (const auto code = parse(app, argc, argv)) return *code;
  const auto systems = all_systems();
  if (describe_only) {
    std::cout << describe_all(systems).dump(1) << std::endl;
    return 0;
  }
  if (role_option->empty() || config_option->empty()) {
    return fail(ExitCode::kBadInput, "--role and --config are needed; see slambed-node --help");
  }
  options.role = role == "edge" ? NodeRole::kEdge : NodeRole::kMobile;
  run_live_node(options, systems);
  return 0;
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::run(argc, argv); });
}
