// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "edgeslam_semantic/mask_transfer.hpp"

namespace slambed::edgeslam_semantic {

/// What culling did to features, against the truth. Those beside somebody, nearer than the border,
/// are rightly culled and not missed.
struct CullingCounts {
  long culled = 0, rightly = 0;   ///< of the culled: on somebody, or within the border
  long on_movers = 0, found = 0;  ///< of those on somebody: culled

  double recall() const { return on_movers > 0 ? double(found) / double(on_movers) : 1; }
  double precision() const { return culled > 0 ? double(rightly) / double(culled) : 1; }
};

struct CullingOptions {
  LabelOptions labels{};
  FeatureTrackOptions tracks{};
  int oldest = 40;  ///< ages of masks from 0, in frames
  int every = 10;   ///< frames from one mask that is tried to the next
  int late = 0;     ///< frames after its own that a mask comes
};

/// What a sequence shows.
struct CullingSequence {
  std::uint64_t frames = 0;
  std::function<std::shared_ptr<const FeatureSet>(std::uint64_t frame)> features;
  std::function<FrameMasks(std::uint64_t frame)> masks, truth;
};

/// How well one mask culls the frames behind it: counts by its age, each mask alone.
std::vector<CullingCounts> culling_by_age(const CullingSequence& sequence,
                                          const CullingOptions& options);

}  // namespace slambed::edgeslam_semantic
