// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/chain_labels.hpp"

#include <algorithm>

namespace slambed::edgeslam_semantic {
namespace {

/// Frames between two walks over all labels.
constexpr int kFramesBetweenWalks = 16;

float middle(std::vector<float>& values) {
  const auto half = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

}  // namespace

void ChainLabels::judge(const ChainFrame& frame, const FrameMasks& masks) {
  check_size(masks, frame.features->sensor().camera);
  const MovingArea area(masks);
  if (frame.number >= newest_) {
    newest_ = frame.number;
    area_ = area;
  }
  const Camera& camera = frame.features->sensor().camera;
  for (std::size_t i = 0; i < frame.chains.size(); ++i) {
    Judgement& known = judged_[frame.chains[i]];
    if (known.mask_frame > frame.number) continue;
    const KeyPoint& at = frame.features->keypoint(static_cast<int>(i));
    known = judgement(area, camera, at.u, at.v);
    known.mask_frame = frame.number;
    known.by_mask = true;
  }
}

ChainLabels::Judgement ChainLabels::judgement(const MovingArea& area, const Camera& camera, float u,
                                              float v) const {
  const Eigen::Vector2d raw = camera.distort(u, v);
  return {.moves = area.covers(raw.x(), raw.y(), options_.border_px),
          .inside = area.covers(raw.x(), raw.y(), 0),
          .u = u,
          .v = v};
}

std::vector<ChainLabels::Guide> ChainLabels::guides(const ChainFrame& frame) const {
  std::vector<Guide> found;
  for (std::size_t i = 0; i < frame.chains.size(); ++i) {
    const auto known = judged_.find(frame.chains[i]);
    if (known == judged_.end() || known->second.mask_frame != newest_ || !known->second.inside)
      continue;
    const KeyPoint& at = frame.features->keypoint(static_cast<int>(i));
    found.push_back({at.u, at.v, at.u - known->second.u, at.v - known->second.v});
  }
  return found;
}

void ChainLabels::place(const ChainFrame& frame) {
  if (options_.neighbours == 0 || newest_ == 0) return;
  const Camera& camera = frame.features->sensor().camera;
  const std::vector<Guide> all = guides(frame);
  std::vector<std::pair<float, const Guide*>> near;
  std::vector<float> du, dv;
  for (std::size_t i = 0; i < frame.chains.size(); ++i) {
    const auto known = judged_.find(frame.chains[i]);
    const bool judged = known != judged_.end();
    if (judged && (known->second.by_mask || known->second.mask_frame == newest_)) continue;
    const KeyPoint& at = frame.features->keypoint(static_cast<int>(i));
    near.clear();
    for (const Guide& guide : all) {
      const float u = guide.u - at.u, v = guide.v - at.v;
      if (u * u + v * v < options_.reach_px * options_.reach_px)
        near.emplace_back(u * u + v * v, &guide);
    }
    if (near.empty()) {
      // What an older mask's neighbours said, the newest one's do not.
      if (judged) judged_.erase(known);
      continue;
    }
    const auto used = std::min(std::ssize(near), std::ptrdiff_t{options_.neighbours});
    std::partial_sort(near.begin(), near.begin() + used, near.end());
    du.clear();
    dv.clear();
    for (const auto& [far, guide] : std::span(near).first(static_cast<std::size_t>(used))) {
      du.push_back(guide->du);
      dv.push_back(guide->dv);
    }
    Judgement placed = judgement(area_, camera, at.u - middle(du), at.v - middle(dv));
    placed.mask_frame = newest_;
    judged_[frame.chains[i]] = placed;
  }
}

void ChainLabels::forget(int frame) {
  if (frame - forgotten_ < kFramesBetweenWalks) return;
  forgotten_ = frame;
  std::erase_if(judged_, [&](const auto& entry) {
    return frame - entry.second.mask_frame > options_.frames;
  });
}

bool ChainLabels::moves(ChainId chain, int frame) const {
  const auto found = judged_.find(chain);
  return found != judged_.end() && found->second.moves &&
         frame - found->second.mask_frame <= options_.frames;
}

}  // namespace slambed::edgeslam_semantic
