// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "link/direction.hpp"
#include "node/run_config.hpp"
#include "runtime/virtual/cost_model.hpp"

namespace slambed {

/// sim.json (docs/formats.md, "Virtual run"): a run.json plus what the world around the nodes is
/// like.
struct SimConfig {
  RunConfig run;
  DeviceModel mobile;
  std::optional<DeviceModel> edge;  ///< with a network
  link::DirectionOptions up, down;
  struct Cache {
    std::filesystem::path path;
    std::string key;
  };
  std::optional<Cache> features;
};

/// bad_input naming the key for anything missing, wrong or unknown.
SimConfig read_sim_config(const std::filesystem::path& path);

}  // namespace slambed
