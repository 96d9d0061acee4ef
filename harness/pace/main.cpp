// SPDX-License-Identifier: Apache-2.0
/// slambed-pace: how fast threads really compute under their limits, and the metronome that keeps
/// the limits exact (docs/limits.md).
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "busy.hpp"
#include "metronome.hpp"

namespace {

using slambed::Error;
using slambed::ExitCode;
using slambed::pace::BusyOptions;
using slambed::pace::MetronomeOptions;

/// As a node of an engine: options and place of the result from a file, no start signal.
int run_as_node(const std::string& config, const std::string& role) {
  std::ifstream file(config);
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (!json.is_object() || !json.contains("output")) {
    throw slambed::bad_input("not a configuration of slambed-pace, " + config);
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
    throw slambed::environment_error("cannot write the result, " + place.string());
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("How fast threads compute under their limits, and a metronome for exact limits");
  BusyOptions busy;
  MetronomeOptions metronome;
  std::string config;
  std::string role = "mobile";
  app.add_option("--threads", busy.threads, "busy threads")->check(CLI::Range(1, 1024));
  app.add_option("--seconds", busy.seconds, "how long")->check(CLI::Range(0.01, 3600.0));
  app.add_option("--settle", busy.settle_s, "seconds before it counts")->check(CLI::Range(0.0, 60.0));
  app.add_option("--config", config, "the same as JSON, and where to write the result");
  app.add_option("--role", role, "with --config: folder of the result");
  auto* tick = app.add_subcommand("tick", "interrupt CPUs regularly until standard input ends");
  tick->add_option("--cpus", metronome.cpus, "CPU numbers")->required()->delimiter(',');
  tick->add_option("--period-us", metronome.period_us, "between two interrupts")
      ->check(CLI::Range(50, 1'000'000));
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::cerr << "error: " << error.what() << ", command line, see --help\n";
    return static_cast<int>(ExitCode::kBadInput);
  }
  try {
    if (tick->parsed()) {
      run_metronome(metronome);
    } else if (!config.empty()) {
      return run_as_node(config, role);
    } else {
      std::cout << busy_json(busy, measure_busy(busy)) << '\n';
    }
    return static_cast<int>(ExitCode::kOk);
  } catch (const Error& error) {
    std::cerr << "error: " << error.what() << '\n';
    return static_cast<int>(error.code());
  } catch (const std::exception& error) {
    std::cerr << "error: internal failure, " << error.what() << ", please report it\n";
    return static_cast<int>(ExitCode::kInternal);
  }
}
