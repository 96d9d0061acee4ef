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
  int frames = 120;   ///< that a label lasts
  int border_px = 3;  ///< around masks
  /// Features followed from the mask that say where a feature without a label would have been in
  /// it; 0: labels go by matches alone.
  int neighbors = 3;
  float reach_px = 50;  ///< as far off as those may be
};

/// A frame as tracks see it.
struct FrameTracks {
  int number = 0;
  std::shared_ptr<const FeatureSet> features;
  std::vector<FeatureTrackId> tracks;  ///< per feature
};

/// Which tracks lie on something that moves. A mask says it of the features of its own frame. Of a
/// feature that began later its neighbors say how they have moved since then, and the mask whether
/// the place that it would have had is covered.
class TrackLabels {
 public:
  explicit TrackLabels(LabelOptions options) : options_(options) {}

  /// The mask of a frame. Newer masks win over older ones.
  void judge(const FrameTracks& frame, const FrameMasks& masks);
  /// Labels what the newest mask has not judged yet in this frame, which is not older than that.
  void place(const FrameTracks& frame);
  /// Forgets what has ended before this frame.
  void forget(int frame);

  bool moves(FeatureTrackId track, int frame) const;
  /// Frame of the newest mask; 0 without one.
  int newest() const { return newest_; }

 private:
  struct Judgment {
    int mask_frame = 0;
    bool moves = false;
    bool inside = false;   ///< not only nearer than the border: its motion is that of the instance
    bool by_mask = false;  ///< of its own frame
    float u = 0, v = 0;    ///< where it was, or would have been, in the mask's frame
  };
  /// A feature inside a mask: where it is, and how far from where it was in the mask's frame.
  struct TrackMotion {
    float u, v, du, dv;
  };
  std::vector<TrackMotion> motions_in_mask(const FrameTracks& frame) const;
  Judgment judgment(const MovingArea& area, const Camera& camera, float u, float v) const;

  LabelOptions options_;
  std::unordered_map<FeatureTrackId, Judgment> judged_;  ///< looked up only, never walked in order
  MovingArea area_;                                      ///< of the newest mask
  int newest_ = 0, forgotten_ = 0;
};

}  // namespace slambed::edgeslam_semantic
