// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "map/map.hpp"

namespace slambed {

/// The map of earlier trips under ids of its own, dense and in the order of the old ones, for a
/// node that knows the keyframes of a new trip only by their ids. Points get the edge mapper's
/// space: a LocalMapper that works on the archive names its own behind them. So do keyframes where
/// the tracker of the new trip counts from one again; a tracker that begins in the archive counts
/// on behind them in its own space (`keyframes`), so that later keyframes have larger ids. Nothing
/// else changes. Copies features by reference.
std::shared_ptr<Map> archive(const Map& map, IdSpace keyframes = IdSpace::kEdgeMapper);

}  // namespace slambed
