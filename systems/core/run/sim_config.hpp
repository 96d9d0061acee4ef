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

/// where: full name of the object, for messages. bad_input as read_sim_config.
LinkModel read_link(const nlohmann::json& json, const std::string& where);

/// sim.json (docs/reference/run-folder.md): a run.json plus the scenario: what
/// surrounds the nodes.
struct SimConfig {
  RunConfig run;
  DeviceModel mobile;
  std::optional<DeviceModel> edge;  ///< with a network
  LinkModel link;
  std::vector<std::pair<RunTime, RunTime>> edge_frozen;  ///< the edge's program stands still
  struct Cache {
    std::filesystem::path path;
    std::string key;
  };
  std::optional<Cache> features, images;
  std::map<double, Cache> masks;  ///< by the segmentation's threshold n_m
};

/// bad_input naming the key for anything missing, wrong or unknown.
SimConfig read_sim_config(const std::filesystem::path& path);

}  // namespace slambed
