// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "node/edge_node.hpp"
#include "store/map_file.hpp"

namespace slambed {

/// The stored map that an edge begins with, under ids of its own (store/archive.hpp).
struct PriorMap {
  std::filesystem::path path;
  MapInfo info;
  std::shared_ptr<Map> map;
};

/// keyframes: the space of their ids. bad_input for a map that is missing, damaged or empty.
PriorMap open_prior_map(const std::filesystem::path& path, IdSpace keyframes);

/// bad_input when the mobile plays another camera than the map's; nothing as long as it has not
/// shown its own.
void check_rig(const PriorMap& prior, const PeerInfo& mobile);

}  // namespace slambed
