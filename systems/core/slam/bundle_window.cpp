// SPDX-License-Identifier: Apache-2.0
#include "slam/bundle_window.hpp"

#include <algorithm>
#include <functional>
#include <utility>

namespace slambed {
namespace {

constexpr std::size_t kLeastKeyFrames = 3;

}  // namespace

std::optional<BundleWindow> BundleWindow::around(const Map& map, KeyFrameId keyframe,
                                                 const BundleOptions& options, Scratch& scratch,
                                                 const BundleLimits& limits) {
  BundleWindow window;
  BundleProblem problem;
  const std::uint32_t run = ++scratch.run;
  auto& features = scratch.features;
  features.clear();
  const bool usable = map.read([&](const MapView& view) {
    const KeyFrame* current = view.keyframe(keyframe);
    if (!current || view.keyframe_count() < kLeastKeyFrames) return false;
    window.epoch_ = view.epoch();
    problem.camera = current->features->sensor().camera;

    /// Returns the index of a keyframe among the poses; appends a new one.
    const auto place_of = [&](KeyFrameId id) {
      Scratch::Mark& mark = *scratch.keyframes.make(id);
      if (mark.run != run) {
        const KeyFrame& k = *view.keyframe(id);
        mark = {run, static_cast<std::uint32_t>(window.poses_.size())};
        window.poses_.push_back({id, k.version});
        problem.T_cw.push_back(k.T_cw);
        features.push_back(k.features.get());
      }
      return mark.place;
    };
    // Free keyframes come first, newest to oldest.
    std::vector<KeyFrameId> moving{keyframe};
    std::vector<KeyFrameId> fixed;
    const auto recent = [&](KeyFrameId id) {
      return view.keyframe(id)->timestamp_s >= limits.since_s;
    };
    for (const Covisible& near : current->covisibles) {
      if (!recent(near.id)) continue;
      if (!limits.size || moving.size() <= limits.size->moving)
        moving.push_back(near.id);
      else if (fixed.size() < limits.size->fixed)
        fixed.push_back(near.id);
    }
    std::sort(moving.begin(), moving.end(), std::greater<>());
    for (const KeyFrameId id : moving)
      if (id != view.origin() && id != limits.held &&
          (!limits.movable || made_by(id, *limits.movable)))
        place_of(id);
    const std::size_t free = window.poses_.size();
    // Fixed keyframes among them come next.
    for (const KeyFrameId id : moving) place_of(id);
    for (const KeyFrameId id : fixed) place_of(id);
    const auto takes_part = [&](KeyFrameId id) {
      if (limits.size) return scratch.keyframes.make(id)->run == run;
      return recent(id);
    };

    for (const KeyFrameId id : moving) {
      for (const MapPointId point_id : view.keyframe(id)->points) {
        if (!point_id) continue;
        Scratch::Mark& mark = *scratch.points.make(point_id);
        if (mark.run == run) continue;
        mark = {run, static_cast<std::uint32_t>(window.points_.size())};
        const MapPoint& point = *view.point(point_id);
        window.points_.push_back({point_id, point.version});
        problem.p_w.push_back(point.p_w);
        for (const Observation& at : point.observations) {
          if (!takes_part(at.keyframe)) continue;
          const std::uint32_t pose = place_of(at.keyframe);
          const KeyPoint& p = features[pose]->keypoint(at.feature);
          problem.observations.push_back({pose, mark.place, p.u, p.v,
                                          p.has_depth() ? p.right_u : -1.0f,
                                          features[pose]->inv_sigma2(at.feature)});
          window.features_.push_back(at.feature);
        }
      }
    }
    // If no keyframe is fixed, the last (oldest) one becomes fixed.
    const bool held = window.poses_.size() > free;
    problem.free_poses = static_cast<int>(held ? free : free - 1);
    return problem.free_poses > 0 && !problem.p_w.empty();
  });
  if (!usable) return std::nullopt;
  window.adjuster_ = std::make_unique<BundleAdjuster>(std::move(problem), options);
  return window;
}

bool BundleWindow::step() { return adjuster_->step(); }

MapDelta BundleWindow::result() const {
  MapDelta delta;
  delta.epoch = epoch_;
  // A half-solved window distorts the map and rejects good observations as outliers.
  if (!adjuster_->robust_stage_done()) return delta;
  const BundleProblem& solved = adjuster_->problem();
  const std::vector<std::uint8_t> outlier = adjuster_->outliers();
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    if (!outlier[i]) continue;
    const BundleObservation& seen = solved.observations[i];
    delta.detach.push_back({poses_[seen.pose].id, features_[i], points_[seen.point].id});
  }
  delta.positions.reserve(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i)
    delta.positions.push_back({points_[i].id, solved.p_w[i], points_[i].version + 1});
  for (int i = 0; i < solved.free_poses; ++i)
    delta.poses.push_back({poses_[i].id, solved.T_cw[i].normalized(), poses_[i].version + 1});
  return delta;
}

}  // namespace slambed
