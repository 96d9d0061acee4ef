// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/node/tests/process.hpp"
#include "apps/node/tests/sockets.hpp"
#include "base/tests/temporary_folder.hpp"
#include "offload/tests/offload_params.hpp"
#include "synth/generator.hpp"

namespace slambed::testing {

constexpr double kFps = 15;

/// Returns a short generated sequence, which is made once per program.
inline const std::filesystem::path& sequence(int frames, synth::GeneratorOptions options) {
  static const TemporaryFolder folder;
  static const std::filesystem::path path = [&] {
    const std::filesystem::path made = folder.path() / "sequence";
    options.width = 320;
    options.height = 240;
    options.fps = kFps;
    options.seconds = frames / options.fps;
    synth::generate(options, made, 2, [](int, int) { return true; });
    return made;
  }();
  return path;
}

/// Returns ports that were free a moment ago.
inline std::vector<int> free_ports(int count) {
  std::vector<int> fds, ports;
  for (int i = 0; i < count; ++i) {
    const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address = loopback(0);
    ::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address);
    socklen_t length = sizeof address;
    ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
    fds.push_back(fd);
    ports.push_back(ntohs(address.sin_port));
  }
  for (const int fd : fds) ::close(fd);
  return ports;
}

/// A run of real processes over loopback, in its own folder.
class NodeProgramTest : public ::testing::Test {
 protected:
  explicit NodeProgramTest(int frames, const synth::GeneratorOptions& options = {}) {
    const auto ports = free_ports(4);
    auto params = enhanced();
    params.update(ours());
    params.update({{"n_orb", 600},
                   {"n_kf", 2},
                   {"sync_period_s", 0.5},
                   {"update_neighbors", 1},
                   {"fast_motion_ms", 0.0}});
    config = {{"format", "slambed-run"},
              {"version", 1},
              {"run_key", "test"},
              {"seed", 1},
              {"variant", "default"},
              {"sequence", sequence(frames, options)},
              {"playback",
               {{"mode", "realtime"}, {"fps", nullptr}, {"start_s", 0.0}, {"end_s", nullptr}}},
              {"output", folder.path()},
              {"connect_timeout_s", 20.0},
              {"system", "edgeslam"},
              {"params", params},
              {"network",
               {{"edge_address", "127.0.0.1"},
                {"ports",
                 {{"control", ports[0]},
                  {"keyframe", ports[1]},
                  {"map", ports[2]},
                  {"frame", ports[3]}}}}}};
  }

  /// Selects another system that maps on the edge, and removes parameters that only Edge-SLAM has.
  void use(const std::string& system) {
    config["system"] = system;
    const auto own = ours();
    for (const auto& item : own.items()) config["params"].erase(item.key());
  }

  void use_orbslam2() {
    config["system"] = "orbslam2";
    config["params"] = {{"n_orb", 600},        {"loop_closing", true},
                        {"sequential", false}, {"second_hypotheses", true},
                        {"contention", false}, {"prior_map", ""},
                        {"save_map", false}};
    config["network"] = nullptr;
  }

  /// Plays only the first seconds of the sequence; returns the number of frames.
  int play_for(double seconds) {
    config["playback"]["end_s"] = seconds;
    return static_cast<int>(std::lround(seconds * kFps));
  }

  /// Plays every frame, at its time or later, so that a slow machine (e.g. under a sanitizer) falls
  /// behind instead of losing track.
  void drop_no_frame() { config["playback"]["mode"] = "every_frame"; }

  Process node(const std::string& role, std::vector<std::string> more = {}) {
    folder.write("run.partial", config.dump());  // the other node may be reading
    std::filesystem::rename(folder.path() / "run.partial", folder.path() / "run.json");
    std::vector<std::string> words = {SLAMBED_NODE, "--role", role, "--config",
                                      folder.path() / "run.json"};
    words.insert(words.end(), more.begin(), more.end());
    return Process(words, folder.path() / (role + ".log"));
  }

  std::string log(const std::string& role) { return read_text(folder.path() / (role + ".log")); }
  nlohmann::json end(const std::string& role) {
    return nlohmann::json::parse(read_text(folder.path() / role / "node.json"));
  }
  bool await(const std::filesystem::path& file) {
    for (int i = 0; i < 6000; ++i) {
      if (std::filesystem::exists(folder.path() / file)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
  /// Waits until the node's log on disk has an event of this type.
  bool await_event(const std::string& role, const std::string& type) {
    for (int i = 0; i < 2400; ++i) {
      if (!events(role, type).empty()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  }
  void start() {
    t0_ns_ = monotonic_ns() + 50'000'000;
    folder.write("start.partial", nlohmann::json{{"t0_ns", t0_ns_}}.dump());
    std::filesystem::rename(folder.path() / "start.partial", folder.path() / "start.json");
  }
  /// Returns the run time, as in events.
  std::int64_t now_ns() const { return monotonic_ns() - t0_ns_; }
  /// Returns a node's events of one type.
  std::vector<nlohmann::json> events(const std::string& role, const std::string& type) {
    std::vector<nlohmann::json> found;
    std::istringstream lines(read_text(folder.path() / role / "events.jsonl"));
    for (std::string line; std::getline(lines, line);) {
      // Filtered before parsing, because a forwarder stalls while the test uses the CPU.
      if (line.find('"' + type + '"') == std::string::npos) continue;
      if (!nlohmann::json::accept(line)) continue;  // truncated by SIGKILL
      auto event = nlohmann::json::parse(line);
      if (event["type"] == type) found.push_back(std::move(event));
    }
    return found;
  }
  /// Expects that the log is one error line with this text.
  void expect_error(const std::string& role, const std::string& part) {
    const std::string text = log(role);
    EXPECT_EQ(text.rfind("error: ", 0), 0u) << text;
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    EXPECT_NE(text.find(part), std::string::npos) << text;
  }

  TemporaryFolder folder;
  nlohmann::json config;

 private:
  static std::int64_t monotonic_ns() {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
  }
  std::int64_t t0_ns_ = 0;
};

}  // namespace slambed::testing
