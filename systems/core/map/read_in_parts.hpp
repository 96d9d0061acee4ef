// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "map/map.hpp"

namespace slambed {

/// Calls visit(view, id) for one id after the other, under the shared lock for so many at a time
/// only: a writer, and all who would read behind it, wait for a part of the map and not for all of
/// it. Between two parts the map may change: what an id names may be gone, or new.
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
