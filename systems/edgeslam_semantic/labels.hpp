// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "features/instances.hpp"
#include "map/map.hpp"

namespace slambed::edgeslam_semantic {

/// Per keyframe, 1 for each feature that lies on something that moves, else 0.
using Labels = std::map<KeyFrameId, std::vector<std::uint8_t>>;

/// Returns 1 for each feature that lies on something that moves or within border_px of it, else 0.
std::vector<std::uint8_t> features_on_masks(const FeatureSet& features, const FrameMasks& masks,
                                            int border_px);

/// Culls points with at least half of their observations on something that moves, and detaches such
/// observations from all other points. One mask alone thus does not delete a background point near
/// a person's outline.
MapDelta without_labeled(const MapView& view, const Labels& labels);

}  // namespace slambed::edgeslam_semantic
