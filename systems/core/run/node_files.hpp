// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

#include "base/ids.hpp"
#include "base/time.hpp"
#include "node/policy.hpp"
#include "run/run_config.hpp"
#include "sequence/prepared_sequence.hpp"

namespace slambed {

/// "mobile" or "edge".
const char* role_name(NodeRole role);

/// Throws bad_input, naming the known systems, if there is no system of this name.
const System& find_system(std::span<const System> systems, const std::string& name);

/// Throws bad_input unless a network is configured exactly if the system has an edge.
void check_network(const System& system, const RunConfig& config, const std::string& where);

/// Returns true if an earlier edge process of this run died without ending, so that its successor
/// joins the running mobile. Call before prepare_node_folder.
bool succeeds_a_dead_edge(const std::filesystem::path& output, NodeRole role);

/// Throws bad_input unless the system supports the sequence's sensor.
void check_sensor(const System& system, const PreparedSequence& sequence);

/// Throws if the mobile may change the number of octaves while the edge extracts the features: the
/// edge would not learn of it.
void check_octaves(const System& system, const Parameters& parameters);

/// Creates <output>/<role> and removes an earlier run's ready.json and node.json. Throws
/// environment_error.
std::filesystem::path prepare_node_folder(const std::filesystem::path& output, NodeRole role);

/// Writes JSON atomically, because readers poll for these files. Throws environment_error.
void write_by_rename(const std::filesystem::path& path, const nlohmann::json& content);

/// Waits for <output>/start.json. Returns run time zero on the monotonic clock, or nothing if
/// stopping() becomes true first. Throws Error if the run does not start within peer_patience (the
/// time to wait for the other node) plus two minutes.
std::optional<Duration> await_start(const std::filesystem::path& output, Duration peer_patience,
                                    const std::function<bool()>& stopping);

/// How a node ended. Written to node.json as its last action.
struct NodeEnd {
  NodeRole role = NodeRole::kMobile;
  std::string reason;                       ///< empty: stopped from outside
  std::optional<std::size_t> frames_total;  ///< offered by playback
  std::optional<MapCounts> counts;          ///< of the node's map, if the core can see it
  int messages_refused = 0;                 ///< received messages that could not be decoded
};
void write_node_end(const std::filesystem::path& folder, const NodeEnd& end);

/// The version that node.json and --version show.
const char* version();

}  // namespace slambed
