// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/track_labels.hpp"

#include <algorithm>

namespace slambed::edgeslam_semantic {
namespace {

/// Frames between two removals of expired labels, each of which visits all labels.
constexpr int kFramesBetweenWalks = 16;

float middle(std::vector<float>& values) {
  const auto half = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

}  // namespace

void TrackLabels::judge(const FrameTracks& frame, const FrameMasks& masks) {
  check_size(masks, frame.features->sensor().camera);
  const MovingArea area(masks);
  if (frame.number >= newest_) {
    newest_ = frame.number;
    area_ = area;
  }
  const Camera& camera = frame.features->sensor().camera;
  for (std::size_t i = 0; i < frame.tracks.size(); ++i) {
    Judgment& known = judged_[frame.tracks[i]];
    if (known.mask_frame > frame.number) continue;
    const KeyPoint& at = frame.features->keypoint(static_cast<int>(i));
    known = judgment(area, camera, at.u, at.v);
    known.mask_frame = frame.number;
    known.by_mask = true;
  }
}

TrackLabels::Judgment TrackLabels::judgment(const MovingArea& area, const Camera& camera, float u,
                                            float v) const {
  const Eigen::Vector2d raw = camera.distort(u, v);
  return {.moves = area.covers(raw.x(), raw.y(), options_.border_px),
          .inside = area.covers(raw.x(), raw.y(), 0),
          .u = u,
          .v = v};
}

std::vector<TrackLabels::TrackMotion> TrackLabels::motions_in_mask(const FrameTracks& frame) const {
  std::vector<TrackMotion> found;
  for (std::size_t i = 0; i < frame.tracks.size(); ++i) {
    const auto known = judged_.find(frame.tracks[i]);
    if (known == judged_.end() || known->second.mask_frame != newest_ || !known->second.inside)
      continue;
    const KeyPoint& at = frame.features->keypoint(static_cast<int>(i));
    found.push_back({at.u, at.v, at.u - known->second.u, at.v - known->second.v});
  }
  return found;
}

void TrackLabels::place(const FrameTracks& frame) {
  if (options_.neighbors == 0 || newest_ == 0) return;
  const Camera& camera = frame.features->sensor().camera;
  const std::vector<TrackMotion> all = motions_in_mask(frame);
  std::vector<std::pair<float, const TrackMotion*>> near;
  std::vector<float> du, dv;
  for (std::size_t i = 0; i < frame.tracks.size(); ++i) {
    const auto known = judged_.find(frame.tracks[i]);
    const bool judged = known != judged_.end();
    if (judged && (known->second.by_mask || known->second.mask_frame == newest_)) continue;
    const KeyPoint& at = frame.features->keypoint(static_cast<int>(i));
    near.clear();
    for (const TrackMotion& motion : all) {
      const float u = motion.u - at.u, v = motion.v - at.v;
      if (u * u + v * v < options_.reach_px * options_.reach_px)
        near.emplace_back(u * u + v * v, &motion);
    }
    if (near.empty()) {
      // Without neighbors in the newest mask, a label placed by an older mask is stale.
      if (judged) judged_.erase(known);
      continue;
    }
    const auto used = std::min(std::ssize(near), std::ptrdiff_t{options_.neighbors});
    std::partial_sort(near.begin(), near.begin() + used, near.end());
    du.clear();
    dv.clear();
    for (const auto& [far, motion] : std::span(near).first(static_cast<std::size_t>(used))) {
      du.push_back(motion->du);
      dv.push_back(motion->dv);
    }
    Judgment placed = judgment(area_, camera, at.u - middle(du), at.v - middle(dv));
    placed.mask_frame = newest_;
    judged_[frame.tracks[i]] = placed;
  }
}

void TrackLabels::forget(int frame) {
  if (frame - forgotten_ < kFramesBetweenWalks) return;
  forgotten_ = frame;
  std::erase_if(judged_, [&](const auto& entry) {
    return frame - entry.second.mask_frame > options_.frames;
  });
}

bool TrackLabels::moves(FeatureTrackId track, int frame) const {
  const auto found = judged_.find(track);
  return found != judged_.end() && found->second.moves &&
         frame - found->second.mask_frame <= options_.frames;
}

}  // namespace slambed::edgeslam_semantic
