// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "edgeslam_semantic/feature_tracks.hpp"
#include "features/instances.hpp"

namespace slambed::edgeslam_semantic {

struct LabelOptions {
  int frames = 120;   ///< lifetime of a label
  int border_px = 3;  ///< border around masks
  /// Tracked features from inside the mask whose median motion places an unlabeled feature in the
  /// masked frame; 0: labels spread by matches only.
  int neighbors = 3;
  float reach_px = 50;  ///< largest distance to those neighbors
};

struct FrameTracks {
  int number = 0;
  std::shared_ptr<const FeatureSet> features;
  std::vector<FeatureTrackId> tracks;  ///< per feature
};

/// Labels tracks that lie on something that moves. A mask labels the features of its own frame. A
/// later feature is first moved back by its neighbors' motion since that frame; its label is then
/// whether the mask covers that place.
class TrackLabels {
 public:
  explicit TrackLabels(LabelOptions options) : options_(options) {}

  /// Labels a frame's features by its mask. Newer masks override older ones.
  void judge(const FrameTracks& frame, const FrameMasks& masks);
  /// Labels features of this frame that the newest mask has not labeled yet. The frame must not be
  /// older than that mask.
  void place(const FrameTracks& frame);
  /// Forgets labels that have expired by this frame.
  void forget(int frame);

  bool moves(FeatureTrackId track, int frame) const;
  /// Frame of the newest mask; 0 without one.
  int newest() const { return newest_; }

 private:
  struct Judgment {
    int mask_frame = 0;
    bool moves = false;
    bool inside = false;   ///< in the mask itself, not only its border: moves with the instance
    bool by_mask = false;  ///< labeled by the mask of its own frame
    float u = 0, v = 0;    ///< measured or estimated position in the mask's frame
  };
  /// A feature that was inside the mask: its position now, and its motion since the mask's frame.
  struct TrackMotion {
    float u, v, du, dv;
  };
  std::vector<TrackMotion> motions_in_mask(const FrameTracks& frame) const;
  Judgment judgment(const MovingArea& area, const Camera& camera, float u, float v) const;

  LabelOptions options_;
  /// Unordered, so its order of iteration must not affect results.
  std::unordered_map<FeatureTrackId, Judgment> judged_;
  MovingArea area_;  ///< of the newest mask
  int newest_ = 0, forgotten_ = 0;
};

}  // namespace slambed::edgeslam_semantic
