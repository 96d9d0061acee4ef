// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <unordered_set>

#include "edgeslam_semantic/feature_chains.hpp"
#include "edgeslam_semantic/labels.hpp"
#include "features/instances.hpp"

namespace slambed::edgeslam_semantic {

/// The paper's mask transfer: masks of keyframes become labels of later frames' features, and of
/// points.
class MaskTransfer {
 public:
  MaskTransfer(ChainOptions options, int border_px) : chains_(options), border_px_(border_px) {}

  /// Follows the chains into the next frame.
  void follow(std::shared_ptr<const FeatureSet> features);
  /// Per feature of it: 1 where no label says that it moves.
  const std::vector<std::uint8_t>& free() const { return free_; }
  /// The frame became a keyframe, of its free features alone.
  void keep(KeyFrameId id);
  /// The same of one that others are compared with (isKeyFrame).
  void keep_for_comparison(KeyFrameId id);

  int features() const { return features_ ? features_->size() : 0; }
  int compared_features() const { return static_cast<int>(compared_.size()); }
  int matched() const { return chains_.shared(compared_); }
  int mask_age() const { return chains_.mask_age(); }

  /// A keyframe's mask. False when the keyframe is not known (any longer).
  bool apply(KeyFrameId id, const FrameMasks& masks);
  /// The labels as they are now of the keyframes kept.
  Labels labels() const;
  /// A new map begins; chains go on.
  void clear();

 private:
  struct Kept {
    int frame = 0;
    std::shared_ptr<const FeatureSet> features;  ///< of the whole frame
    std::vector<ChainId> chains;                 ///< of the whole frame
    std::vector<ChainId> own_chains;             ///< of the keyframe's features
  };
  /// Keyframes that are older than any label go, whether or not a mask has ever come.
  void forget_old();

  FeatureChains chains_;
  int border_px_;
  std::shared_ptr<const FeatureSet> features_;
  std::vector<std::uint8_t> free_;
  std::unordered_set<ChainId> compared_;
  std::map<KeyFrameId, Kept> kept_;
};

}  // namespace slambed::edgeslam_semantic
