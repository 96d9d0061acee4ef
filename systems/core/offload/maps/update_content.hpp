// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "map/map.hpp"

namespace slambed {

/// The delta's own keyframes, ascending.
std::vector<KeyFrameId> keyframes_of(const MapDelta& delta);

/// These keyframes (those that still exist) with all points they see: a map of its own.
MapDelta extract_keyframes(const MapView& view, std::span<const KeyFrameId> keyframes);

/// Adds the count best covisibles of each keyframe to the list, no keyframe twice.
std::vector<KeyFrameId> with_covisibles(const MapView& view, std::vector<KeyFrameId> keyframes,
                                        int count);

}  // namespace slambed
