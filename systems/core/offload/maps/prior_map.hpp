// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "node/edge_node.hpp"
#include "store/map_file.hpp"

namespace slambed {

/// The stored map that an edge starts with, under new ids (store/archive.hpp).
struct PriorMap {
  std::filesystem::path path;
  MapInfo info;
  std::shared_ptr<Map> map;
};

/// keyframes: their id space. Throws bad_input for a map that is missing, damaged or empty.
PriorMap open_prior_map(const std::filesystem::path& path, IdSpace keyframes);

/// Throws bad_input if the mobile's camera is not the map's. Does nothing until the mobile has sent
/// its camera.
void check_rig(const PriorMap& prior, const PeerInfo& mobile);

}  // namespace slambed
