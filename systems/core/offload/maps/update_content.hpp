// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "map/map.hpp"

namespace slambed {

/// Returns the ids of the delta's new keyframes, ascending.
std::vector<KeyFrameId> keyframes_of(const MapDelta& delta);

/// Extracts these keyframes, if they still exist, with all points they see: a self-contained map.
MapDelta extract_keyframes(const MapView& view, std::span<const KeyFrameId> keyframes);

/// Adds the `count` best covisibles of each keyframe to the list, without duplicates.
std::vector<KeyFrameId> with_covisibles(const MapView& view, std::vector<KeyFrameId> keyframes,
                                        int count);

}  // namespace slambed
