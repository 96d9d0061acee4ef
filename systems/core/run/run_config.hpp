// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/ids.hpp"
#include "node/playback.hpp"
#include "node/rtt_table.hpp"
#include "runtime/cost_model.hpp"

namespace slambed {

struct NetworkConfig {
  std::string edge_address;
  std::map<std::string, std::uint16_t> ports;  ///< by channel
  std::optional<RttTable> profile_rtt{};
};

/// Where the edge node has pictures segmented.
struct SegmenterConfig {
  std::filesystem::path socket;
  double time_limit_s = 2;
};

/// The device whose pace a node keeps.
struct PaceConfig {
  double share = 1;  ///< of a CPU of the host that one of its cores is
  DeviceModel device;
};

/// run.json (docs/reference/run-folder.md). params are checked by the system's own list.
struct RunConfig {
  std::string run_key;
  std::uint64_t seed = 0;
  std::string system, variant;
  nlohmann::json params;
  std::filesystem::path sequence;
  PlaybackConfig playback;
  std::optional<NetworkConfig> network;
  std::optional<SegmenterConfig> segmenter{};
  std::map<NodeRole, PaceConfig> pace{};  ///< live runs at a device's pace; empty: at this host's
  std::filesystem::path output;
  double connect_timeout_s = 20;
};

/// bad_input naming the key for anything missing, wrong or unknown.
RunConfig read_run_config(const std::filesystem::path& path);

}  // namespace slambed
