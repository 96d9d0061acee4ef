// SPDX-License-Identifier: Apache-2.0
/// slambed-pace: measures how fast threads compute under CPU limits, and runs the metronome that
/// keeps these limits exact (docs/explanation/limits.md).
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "apps/pace/busy.hpp"
#include "apps/pace/metronome.hpp"
#include "base/program.hpp"

namespace slambed::pace {
namespace {

/// Runs as a node of an engine: a file has the options and the output folder. There is no start
/// signal.
int run_as_node(const std::string& config, const std::string& role) {
  std::ifstream file(config);
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (!json.is_object() || !json.contains("output")) {
    throw bad_input("not a configuration of slambed-pace, " + config);
  }
  BusyOptions options;
  options.threads = json.value("threads", options.threads);
  options.seconds = json.value("seconds", options.seconds);
  options.settle_s = json.value("settle_s", options.settle_s);
  const auto result = measure_busy(options);
  const auto place = std::filesystem::path(json["output"].get<std::string>()) / role / "pace.json";
  std::ofstream out(place);
  out << busy_json(options, result) << '\n';
  if (!out.flush()) {
    throw environment_error("cannot write the result, " + place.string());
  }
  return 0;
}

int run(int argc, char** argv) {
  CLI::App app("How fast threads compute under their limits, and a metronome for exact limits");
  app.name("slambed-pace");
  BusyOptions busy;
  MetronomeOptions metronome;
  std::string config;
  std::string role = "mobile";
  app.add_option("--threads", busy.threads, "busy threads")->check(CLI::Range(1, 1024));
  app.add_option("--seconds", busy.seconds, "how long")->check(CLI::Range(0.01, 3600.0));
  app.add_option("--settle", busy.settle_s, "seconds before it counts")
      ->check(CLI::Range(0.0, 60.0));
  app.add_option("--config", config, "the same as JSON, and where to write the result");
  app.add_option("--role", role, "with --config: folder of the result");
  auto* tick = app.add_subcommand("tick", "interrupt CPUs regularly until standard input ends");
  tick->add_option("--cpus", metronome.cpus, "CPU numbers")->required()->delimiter(',');
  tick->add_option("--period-us", metronome.period_us, "between two interrupts")
      ->check(CLI::Range(50, 1'000'000));
  if (const auto code = parse(app, argc, argv)) return *code;
  if (tick->parsed()) {
    run_metronome(metronome);
  } else if (!config.empty()) {
    return run_as_node(config, role);
  } else {
    std::cout << busy_json(busy, measure_busy(busy)) << '\n';
  }
  return 0;
}

}  // namespace
}  // namespace slambed::pace

int main(int argc, char** argv) {
  return slambed::run_program([&] { return slambed::pace::run(argc, argv); });
}
