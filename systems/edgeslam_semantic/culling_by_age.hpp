// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "edgeslam_semantic/mask_transfer.hpp"

namespace slambed::edgeslam_semantic {

/// Counts of culled features against the true masks. A feature outside a mask but within its border
/// is correct to cull, and no miss if it is kept.
struct CullingCounts {
  long culled = 0, rightly = 0;   ///< rightly: culled features on a mover or within its border
  long on_movers = 0, found = 0;  ///< found: features on a mover that were culled

  double recall() const { return on_movers > 0 ? double(found) / double(on_movers) : 1; }
  double precision() const { return culled > 0 ? double(rightly) / double(culled) : 1; }
};

struct CullingOptions {
  LabelOptions labels{};
  FeatureTrackOptions tracks{};
  int oldest = 40;  ///< largest age of a mask that is counted, in frames
  int every = 10;   ///< frames between two masks that are tried
  int late = 0;     ///< delay of a mask's arrival, in frames
};

struct CullingSequence {
  std::uint64_t frames = 0;
  double fps = 0;  ///< frame rate of the camera; must be set
  std::function<std::shared_ptr<const FeatureSet>(std::uint64_t frame)> features;
  std::function<FrameMasks(std::uint64_t frame)> masks, truth;
};

/// Applies every tried mask on its own and counts how well it culls the frames after it. Returns
/// one entry per age of the mask, from 0 to options.oldest.
std::vector<CullingCounts> culling_by_age(const CullingSequence& sequence,
                                          const CullingOptions& options);

}  // namespace slambed::edgeslam_semantic
