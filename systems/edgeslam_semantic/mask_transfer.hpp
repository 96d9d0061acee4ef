// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <unordered_set>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/track_labels.hpp"

namespace slambed::edgeslam_semantic {

/// The paper's mask transfer: masks of keyframes become labels of later frames' features, and of
/// points.
class MaskTransfer {
 public:
  explicit MaskTransfer(LabelOptions labels, FeatureTrackOptions tracks = {})
      : tracks_(tracks), labels_(labels) {}

  /// Continues the feature tracks into the next frame.
  void track(std::shared_ptr<const FeatureSet> features);
  /// Per feature of it: 1 where no label says that it moves.
  const std::vector<std::uint8_t>& free() const { return free_; }
  /// The frame became a keyframe, of its free features alone.
  void keep(KeyFrameId id);
  /// The same of one that others are compared with (isKeyFrame).
  void keep_for_comparison(KeyFrameId id);

  int compared_features() const { return static_cast<int>(compared_.size()); }
  int matched() const { return tracks_.shared(compared_); }
  /// Age of the mask that the newest frame stands on, in frames; negative without one.
  int mask_age() const { return labels_.newest() > 0 ? tracks_.frame() - labels_.newest() : -1; }

  /// A keyframe's mask, however late: the frames since then, up to 60, are labeled as if it had
  /// come at once. False when the keyframe is not known (any longer).
  bool apply(KeyFrameId id, const FrameMasks& masks);
  /// The labels as they are now of the keyframes kept.
  Labels labels() const;
  /// A new map begins; tracks go on.
  void clear();

 private:
  struct Kept {
    std::shared_ptr<const FrameTracks> frame;
    std::vector<FeatureTrackId> own_tracks;  ///< of the keyframe's features
  };
  /// Keyframes that are older than any label go, whether or not a mask has ever come.
  void forget_old();
  void set_free();

  FeatureTracks tracks_;
  TrackLabels labels_;
  std::deque<std::shared_ptr<const FrameTracks>> past_;  ///< the newest frames, the last is now
  std::vector<std::uint8_t> free_;
  std::unordered_set<FeatureTrackId> compared_;
  std::map<KeyFrameId, Kept> kept_;
};

}  // namespace slambed::edgeslam_semantic
