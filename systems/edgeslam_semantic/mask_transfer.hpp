// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <unordered_set>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/track_labels.hpp"

namespace slambed::edgeslam_semantic {

/// The paper's mask transfer: turns masks of keyframes into labels of later frames' features and of
/// keyframes' features.
class MaskTransfer {
 public:
  explicit MaskTransfer(LabelOptions labels, FeatureTrackOptions tracks = {});

  /// Continues the feature tracks into the next frame.
  void track(std::shared_ptr<const FeatureSet> features, double time_s);
  /// Per feature of the newest frame: 1 unless a label marks it as moving.
  const std::vector<std::uint8_t>& free() const { return free_; }
  /// Notes that the newest frame became a keyframe, which has only the free features.
  void keep(KeyFrameId id);
  /// Like keep(), and later frames are compared with this keyframe (isKeyFrame).
  void keep_for_comparison(KeyFrameId id);

  int compared_features() const { return static_cast<int>(compared_.size()); }
  int matched() const { return tracks_.shared(compared_); }
  /// Age in frames of the newest mask, or -1 without one.
  int mask_age() const { return labels_.newest() > 0 ? tracks_.frame() - labels_.newest() : -1; }

  /// Applies a keyframe's mask. A late mask labels up to 60 frames since its keyframe as if it had
  /// come at once. Returns false if the keyframe is unknown or forgotten.
  bool apply(KeyFrameId id, const FrameMasks& masks);
  /// Returns the current labels of all kept keyframes.
  Labels labels() const;
  /// Forgets all keyframes because a new map begins; tracks and labels continue.
  void clear();

 private:
  struct Kept {
    std::shared_ptr<const FrameTracks> frame;
    std::vector<FeatureTrackId> own_tracks;  ///< of the keyframe's features
  };
  /// Forgets keyframes whose labels have expired for a while, whether or not their masks have come.
  void forget_old();
  void set_free();

  FeatureTracks tracks_;
  TrackLabels labels_;
  int kept_frames_;  ///< age in frames at which a keyframe is forgotten
  std::deque<std::shared_ptr<const FrameTracks>> past_;  ///< newest frames, newest last
  std::vector<std::uint8_t> free_;
  std::unordered_set<FeatureTrackId> compared_;
  std::map<KeyFrameId, Kept> kept_;
};

}  // namespace slambed::edgeslam_semantic
