// SPDX-License-Identifier: Apache-2.0
#include "run/node_files.hpp"

#include <thread>

#include "base/error.hpp"
#include "base/files.hpp"
#include "base/json_reader.hpp"
#include "runtime/live/live_runtime.hpp"

namespace slambed {

namespace fs = std::filesystem;

namespace {

constexpr Duration kLookForStart = std::chrono::milliseconds(5);
/// After both nodes are ready, the harness has this long to start the run.
constexpr Duration kStartPatience = std::chrono::seconds(120);

}  // namespace

const char* version() { return SLAMBED_VERSION; }

const char* role_name(NodeRole role) { return role == NodeRole::kMobile ? "mobile" : "edge"; }

const System& find_system(std::span<const System> systems, const std::string& name) {
  std::string known;
  for (const System& system : systems) {
    if (system.name == name) return system;
    known += (known.empty() ? "" : ", ") + system.name;
  }
  throw bad_input("system '" + name + "' is unknown; choose one of: " + known);
}

void check_network(const System& system, const RunConfig& config, const std::string& where) {
  const bool alone = system.channels.empty();
  if (alone != config.network.has_value()) return;
  throw bad_input(where + ": network must be " + (alone ? "null: " : "given: ") + system.name +
                  (alone ? " has no edge" : " needs an edge"));
}

bool succeeds_a_dead_edge(const fs::path& output, NodeRole role) {
  const fs::path folder = output / role_name(role);
  return role == NodeRole::kEdge && fs::exists(output / "start.json") &&
         fs::exists(folder / "events.jsonl") && !fs::exists(folder / "node.json");
}

void check_sensor(const System& system, const PreparedSequence& sequence) {
  std::string known;
  for (const SensorKind kind : system.sensors) {
    if (kind == sequence.sensor()) return;
    known += (known.empty() ? "" : ", ") + std::string(sensor_name(kind));
  }
  throw bad_input("sequence '" + sequence.id() + "' is " + sensor_name(sequence.sensor()) + ", " +
                  system.name + " plays " + known + "; choose another sequence or system");
}

void check_octaves(const System& system, const Parameters& parameters) {
  if (!system.orb_levels || !system.extracts_on_edge || !system.extracts_on_edge(parameters))
    return;
  const int fixed = system.orb(parameters).levels;
  for (const int levels : system.orb_levels(parameters)) {
    if (levels == fixed) continue;
    throw bad_input("system " + system.name + " extracts features on the edge, always from " +
                    std::to_string(fixed) + " octaves; its mobile may not change to " +
                    std::to_string(levels));
  }
}

fs::path prepare_node_folder(const fs::path& output, NodeRole role) {
  const fs::path folder = output / role_name(role);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw environment_error(folder.string() + ": " + error.message() +
                            "; give an output folder that can be written");
  }
  for (const char* name : {"ready.json", "node.json"}) fs::remove(folder / name, error);
  return folder;
}

void write_by_rename(const fs::path& path, const nlohmann::json& content) {
  write_whole(path, content.dump(1) + "\n");
}

std::optional<Duration> await_start(const fs::path& output, Duration peer_patience,
                                    const std::function<bool()>& stopping) {
  const fs::path path = output / "start.json";
  const Duration patience = peer_patience + kStartPatience;
  const RunTime deadline = monotonic_now() + patience;
  while (!fs::exists(path)) {
    if (stopping()) return std::nullopt;
    if (monotonic_now() >= deadline) {
      throw Error(ExitCode::kPeer, path.string() + ": did not appear within " +
                                       std::to_string(static_cast<int>(to_seconds(patience))) +
                                       " s; whoever starts the run must write it");
    }
    std::this_thread::sleep_for(kLookForStart);
  }
  const nlohmann::json json = read_json(path);
  JsonReader in(json, path.string() + ": ");
  const Duration t0(in.integer("t0_ns", 0, INT64_MAX));
  in.done();
  return t0;
}

void write_node_end(const fs::path& folder, const NodeEnd& end) {
  nlohmann::json node{{"role", role_name(end.role)}, {"version", version()}};
  if (end.frames_total) node["frames_total"] = *end.frames_total;
  node["stopped"] = end.reason.empty();
  node["exit_reason"] = end.reason.empty() ? "stopped" : end.reason;
  if (end.counts) {
    node["keyframes"] = end.counts->keyframes;
    node["map_points"] = end.counts->points;
  }
  if (end.messages_refused > 0) node["messages_refused"] = end.messages_refused;
  write_by_rename(folder / "node.json", node);
}

}  // namespace slambed
