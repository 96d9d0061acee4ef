// SPDX-License-Identifier: Apache-2.0
// slambed-sim: a whole run in virtual time. docs/reference/run-folder.md describes its files and
// exit codes.
#include <CLI/CLI.hpp>
#include <iostream>

#include "apps/registry/systems.hpp"
#include "base/error.hpp"
#include "base/machine.hpp"
#include "base/program.hpp"
#include "run/message_trace.hpp"
#include "run/node_files.hpp"
#include "run/virtual_run.hpp"
#include "sequence/image_source.hpp"

namespace slambed {
namespace {

int simulate(int argc, char** argv) {
  CLI::App app(
      "Both nodes of a slambed run in virtual time: reads sim.json, leaves the files that "
      "live nodes leave. Equal inputs give equal bytes.");
  app.name("slambed-sim");
  app.set_version_flag("--version", std::string("slambed-sim ") + version());
  app.add_flag_callback(
      "--machine",
      [] {
        std::cout << machine_json(SLAMBED_LIBRARIES) << std::endl;
        throw CLI::Success();
      },
      "what results hang on besides inputs and sources, as JSON: it is in the run key");
  std::filesystem::path config;
  std::filesystem::path messages;
  auto* source = app.add_option_group("source")->require_option(1);
  source->add_option("--config", config, "path of sim.json");
  source->add_option("--messages", messages,
                     "path of a message trace: only the link, arrivals on standard output");
  std::filesystem::path images, sequence;
  std::string key;
  int quality = 0;
  auto* pictures = source->add_option(
      "--images", images, "image cache to make, where there is none with this key: nothing is run");
  app.add_option("--sequence", sequence, "of --images: folder of the prepared sequence")
      ->needs(pictures);
  app.add_option("--quality", quality, "of --images: of the JPEGs")
      ->needs(pictures)
      ->check(CLI::Range(1, 100));
  app.add_option("--key", key, "of --images: what names the pictures")->needs(pictures);
  if (const auto code = parse(app, argc, argv)) return *code;
  if (!images.empty()) {
    if (sequence.empty() || quality == 0)
      throw bad_input("--images: give --sequence and --quality, too");
    ImageCache(images, key, PreparedSequence(sequence), quality);
  } else if (!messages.empty()) {
    play_message_trace(messages, std::cout);
  } else {
    run_virtually(config, all_systems());
  }
  return 0;
}

}  // namespace
}  // namespace slambed

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::simulate(argc, argv); });
}
