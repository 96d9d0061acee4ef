// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/mask_transfer.hpp"

namespace slambed::edgeslam_semantic {
namespace {

/// Frames after which a keyframe's mask is not waited for any more: labels of it would have ended.
constexpr int kKeptFrames = 150;

}  // namespace

void MaskTransfer::follow(std::shared_ptr<const FeatureSet> features) {
  features_ = std::move(features);
  chains_.follow(*features_);
  free_ = chains_.free();
}

void MaskTransfer::keep(KeyFrameId id) {
  const auto ids = chains_.ids();
  Kept kept{.frame = chains_.frame(),
            .features = features_,
            .chains = {ids.begin(), ids.end()},
            .own_chains = {}};
  for (std::size_t i = 0; i < ids.size(); ++i)
    if (free_[i]) kept.own_chains.push_back(ids[i]);
  kept_[id] = std::move(kept);
  forget_old();
}

void MaskTransfer::keep_for_comparison(KeyFrameId id) {
  keep(id);
  const auto ids = chains_.ids();
  compared_ = {ids.begin(), ids.end()};
}

bool MaskTransfer::apply(KeyFrameId id, const FrameMasks& masks) {
  const auto found = kept_.find(id);
  if (found == kept_.end()) return false;
  const Kept& kept = found->second;
  chains_.label(kept.chains, features_on_masks(*kept.features, masks, border_px_), kept.frame);
  return true;
}

Labels MaskTransfer::labels() const {
  Labels labels;
  for (const auto& [id, kept] : kept_) {
    std::vector<std::uint8_t>& moves = labels[id];
    moves.reserve(kept.own_chains.size());
    for (const ChainId chain : kept.own_chains) moves.push_back(chains_.labelled(chain));
  }
  return labels;
}

void MaskTransfer::forget_old() {
  std::erase_if(kept_, [this](const auto& entry) {
    return chains_.frame() - entry.second.frame > kKeptFrames;
  });
}

void MaskTransfer::clear() {
  kept_.clear();
  compared_.clear();
}

}  // namespace slambed::edgeslam_semantic
