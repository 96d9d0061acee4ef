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

/// Where the edge node sends images for segmentation.
struct SegmenterConfig {
  std::filesystem::path socket;
  double time_limit_s = 2;
};

/// The device whose speed a live node imitates.
struct PaceConfig {
  double share = 1;  ///< one core of the device as a share of a CPU of the host
  DeviceModel device;
};

/// run.json (docs/reference/run-folder.md, "Run configuration"). The system's parameter specs check
/// params.
struct RunConfig {
  std::string run_key;
  std::uint64_t seed = 0;
  std::string system, variant;
  nlohmann::json params;
  std::filesystem::path sequence;
  PlaybackConfig playback;
  std::optional<NetworkConfig> network;
  std::optional<SegmenterConfig> segmenter{};
  std::map<NodeRole, PaceConfig> pace{};  ///< for live runs; empty: run at the host's speed
  std::filesystem::path output;
  double connect_timeout_s = 20;
};

/// Throws bad_input with the name of a missing, invalid or unknown key.
RunConfig read_run_config(const std::filesystem::path& path);

}  // namespace slambed
