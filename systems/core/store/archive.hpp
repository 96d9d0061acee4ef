// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "map/map.hpp"

namespace slambed {

/// The map of earlier trips under ids of its own, for a node that knows the keyframes of a new trip
/// only by their ids: the tracker of that trip counts from one again, in a space where the archive
/// then has nothing. Keyframes and points get the edge mapper's space, dense and in the order of
/// their ids; a LocalMapper that works on the archive names its points behind them. Nothing else
/// changes. Copies features by reference.
std::shared_ptr<Map> archive(const Map& map);

}  // namespace slambed
