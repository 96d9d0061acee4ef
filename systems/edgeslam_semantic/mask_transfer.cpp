// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/mask_transfer.hpp"

#include <algorithm>

namespace slambed::edgeslam_semantic {
namespace {

/// A keyframe is kept for this many frames longer than labels last: its mask may come late.
constexpr int kKeptBeyondLabels = 30;

/// Past frames that a late mask can still label.
constexpr std::size_t kPastFrames = 60;

}  // namespace

MaskTransfer::MaskTransfer(LabelOptions labels, FeatureTrackOptions tracks)
    : tracks_(tracks), labels_(labels), kept_frames_(labels.frames + kKeptBeyondLabels) {}

void MaskTransfer::track(std::shared_ptr<const FeatureSet> features, double time_s) {
  const auto ids = tracks_.track(*features, time_s);
  past_.push_back(std::make_shared<FrameTracks>(
      FrameTracks{tracks_.frame(), std::move(features), {ids.begin(), ids.end()}}));
  if (past_.size() > kPastFrames) past_.pop_front();
  labels_.forget(tracks_.frame());
  labels_.place(*past_.back());
  set_free();
}

void MaskTransfer::set_free() {
  const auto ids = tracks_.ids();
  free_.resize(ids.size());
  std::transform(ids.begin(), ids.end(), free_.begin(), [this](FeatureTrackId track) {
    return labels_.moves(track, tracks_.frame()) ? std::uint8_t{0} : std::uint8_t{1};
  });
}

void MaskTransfer::keep(KeyFrameId id) {
  const auto ids = tracks_.ids();
  Kept kept{.frame = past_.back(), .own_tracks = {}};
  for (std::size_t i = 0; i < ids.size(); ++i)
    if (free_[i]) kept.own_tracks.push_back(ids[i]);
  kept_[id] = std::move(kept);
  forget_old();
}

void MaskTransfer::keep_for_comparison(KeyFrameId id) {
  keep(id);
  const auto ids = tracks_.ids();
  compared_ = {ids.begin(), ids.end()};
}

bool MaskTransfer::apply(KeyFrameId id, const FrameMasks& masks) {
  const auto found = kept_.find(id);
  if (found == kept_.end()) return false;
  const FrameTracks& masked = *found->second.frame;
  labels_.judge(masked, masks);
  if (labels_.newest() == masked.number) {
    for (const auto& frame : past_)
      if (frame->number > masked.number) labels_.place(*frame);
  }
  set_free();
  return true;
}

Labels MaskTransfer::labels() const {
  Labels labels;
  for (const auto& [id, kept] : kept_) {
    std::vector<std::uint8_t>& moves = labels[id];
    moves.reserve(kept.own_tracks.size());
    for (const FeatureTrackId track : kept.own_tracks)
      moves.push_back(labels_.moves(track, tracks_.frame()));
  }
  return labels;
}

void MaskTransfer::forget_old() {
  std::erase_if(kept_, [this](const auto& entry) {
    return tracks_.frame() - entry.second.frame->number > kept_frames_;
  });
}

void MaskTransfer::clear() {
  kept_.clear();
  compared_.clear();
}

}  // namespace slambed::edgeslam_semantic
