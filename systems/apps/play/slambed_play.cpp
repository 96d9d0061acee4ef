// SPDX-License-Identifier: Apache-2.0
// slambed-play: a node whose system is an external program (docs/reference/system.md).
#include <chrono>
#include <filesystem>
#include <thread>

#include "apps/play/player.hpp"
#include "base/program.hpp"
#include "run/node_files.hpp"

namespace slambed {
namespace {

constexpr auto kStartBarrierPoll = std::chrono::milliseconds(20);

int run(int argc, char** argv) {
  CLI::App app(
      "A node that plays a sequence to another program: offers frames on the run's clock, takes "
      "poses, leaves events and trajectories. The program and its arguments stand behind --.");
  app.name("slambed-play");
  app.set_version_flag("--version", std::string("slambed-play ") + version());
  PlayerOptions options;
  std::string role, start_barrier;
  bool no_client = false;
  app.add_option("--role", role, "mobile or edge")
      ->required()
      ->check(CLI::IsMember({"mobile", "edge"}));
  app.add_option("--config", options.config, "path of run.json")->required();
  app.add_option("--start-barrier", start_barrier, "do nothing before this file is there");
  app.add_option("--directory", options.directory, "where the program starts");
  app.add_flag("--no-client", no_client, "the program does not speak to the player");
  app.add_option("--trajectory", options.trajectory,
                 "TUM file that a program without client leaves in $SLAMBED_OUTPUT");
  app.add_option("command", options.command, "the program")->required();
  if (const auto code = parse(app, argc, argv)) return *code;
  while (!start_barrier.empty() && !std::filesystem::exists(start_barrier))
    std::this_thread::sleep_for(kStartBarrierPoll);
  options.role = role == "edge" ? NodeRole::kEdge : NodeRole::kMobile;
  options.client = !no_client;
  return play(options);
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::run(argc, argv); });
}
