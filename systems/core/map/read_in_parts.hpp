// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "map/map.hpp"

namespace slambed {

/// Calls visit(view, id) for each id and releases the shared lock between batches. A writer, and
/// readers queued behind it, thus wait for one batch only. The map may change between batches, so
/// an id may have become invalid.
template <typename IdType, typename Visit>
void read_in_parts(const Map& map, const std::vector<IdType>& ids, Visit visit) {
  constexpr std::size_t kPart = 256;
  for (std::size_t begin = 0; begin < ids.size(); begin += kPart) {
    const std::size_t end = std::min(ids.size(), begin + kPart);
    map.read([&](const MapView& view) {
      for (std::size_t i = begin; i < end; ++i) visit(view, ids[i]);
    });
  }
}

}  // namespace slambed
