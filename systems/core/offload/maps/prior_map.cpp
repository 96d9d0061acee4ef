// SPDX-License-Identifier: Apache-2.0
#include "offload/maps/prior_map.hpp"

#include "base/error.hpp"
#include "node/map_keeping.hpp"
#include "store/archive.hpp"

namespace slambed {

PriorMap open_prior_map(const std::filesystem::path& path, IdSpace keyframes) {
  if (path.empty()) {
    throw bad_input("params: prior_map is empty; the edge needs the map of an earlier trip");
  }
  const StoredMap stored = load_map(path);
  if (count(*stored.map).keyframes == 0) {
    throw bad_input("map " + path.string() + ": has no keyframes that a trip could be found in");
  }
  return {path, stored.info, archive(*stored.map, keyframes)};
}

void check_rig(const PriorMap& prior, const PeerInfo& mobile) {
  if (const auto played = mobile.info()) require_same_rig(prior.info.sensor, *played, prior.path);
}

}  // namespace slambed
