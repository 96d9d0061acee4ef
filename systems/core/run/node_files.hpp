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

/// bad_input naming the known ones.
const System& find_system(std::span<const System> systems, const std::string& name);

/// bad_input unless a network is given exactly where the system has an edge.
void check_network(const System& system, const RunConfig& config, const std::string& where);

/// True when an edge of this run was here before and did not end: its successor joins the running
/// mobile. Asked before the folder is prepared.
bool succeeds_a_dead_edge(const std::filesystem::path& output, NodeRole role);

/// bad_input unless the system can do with what the sequence brings.
void check_sensor(const System& system, const PreparedSequence& sequence);

/// Creates <output>/<role> and removes what an earlier run said there; environment_error.
std::filesystem::path prepare_node_folder(const std::filesystem::path& output, NodeRole role);

/// Writes JSON whole or not at all: readers poll for these files. environment_error.
void write_by_rename(const std::filesystem::path& path, const nlohmann::json& content);

/// Waits for <output>/start.json. Run time zero on the monotonic clock; nothing when stopping()
/// says so before. Error where nobody starts the run within peer_patience, for the other node, and
/// two minutes more.
std::optional<Duration> await_start(const std::filesystem::path& output, Duration peer_patience,
                                    const std::function<bool()>& stopping);

/// How a node ended; written as node.json, the last thing of its life.
struct NodeEnd {
  NodeRole role = NodeRole::kMobile;
  std::string reason;                       ///< empty: stopped from outside
  std::optional<std::size_t> frames_total;  ///< offered by playback
  std::optional<MapCounts> counts;          ///< where the node has a map that we know
  int messages_refused = 0;                 ///< that could not be read
};
void write_node_end(const std::filesystem::path& folder, const NodeEnd& end);

/// The version that node.json and --version show.
const char* version();

}  // namespace slambed
