// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "link/direction.hpp"
#include "run/run_config.hpp"
#include "runtime/cost_model.hpp"

namespace slambed {

/// Both directions of a link, as slambed-relay reads them.
struct LinkModel {
  link::DirectionOptions up, down;
};

/// where: full name of the object, for messages. Throws bad_input as read_sim_config does.
LinkModel read_link(const nlohmann::json& json, const std::string& where);

/// sim.json (docs/reference/run-folder.md, "Virtual run"): a run.json plus the devices, link and
/// caches of a virtual run.
struct SimConfig {
  RunConfig run;
  DeviceModel mobile;
  std::optional<DeviceModel> edge;  ///< present if there is a network
  LinkModel link;
  std::vector<std::pair<RunTime, RunTime>> edge_frozen;  ///< [begin, end) of each edge freeze
  std::optional<RunTime> limit;  ///< virtual time at which a run is stopped that has not ended
  struct Cache {
    std::filesystem::path path;
    std::string key;
  };
  std::optional<Cache> features, images;
  std::map<double, Cache> masks;  ///< by the segmentation's threshold n_m
};

/// Throws bad_input with the name of a missing, invalid or unknown key.
SimConfig read_sim_config(const std::filesystem::path& path);

}  // namespace slambed
