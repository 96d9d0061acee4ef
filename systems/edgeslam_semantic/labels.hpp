// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "features/instances.hpp"
#include "map/map.hpp"

namespace slambed::edgeslam_semantic {

/// Of keyframes: which features lie on something that moves (1).
using Labels = std::map<KeyFrameId, std::vector<std::uint8_t>>;

/// Which features lie on something that moves, or nearer to it than the border: 1 for those.
std::vector<std::uint8_t> features_on_masks(const FeatureSet& features, const FrameMasks& masks,
                                            int border_px);

/// What a map does without: points at least half of whose observations lie on something that moves,
/// and of the others those observations. A point behind somebody's outline is thus not lost with
/// one mask.
MapDelta without_labeled(const MapView& view, const Labels& labels);

}  // namespace slambed::edgeslam_semantic
