// SPDX-License-Identifier: Apache-2.0
#include "slam/global_bundle.hpp"

#include <algorithm>
#include <utility>

#include "slam/map_correction.hpp"

namespace slambed {

std::optional<GlobalBundle> GlobalBundle::of(const Map& map, const BundleOptions& options) {
  GlobalBundle bundle;
  BundleProblem problem;
  const bool usable = map.read([&](const MapView& view) {
    bundle.keyframes_ = view.keyframe_ids();
    if (bundle.keyframes_.size() < 2) return false;
    problem.camera = view.keyframe(bundle.keyframes_.front())->features->sensor().camera;
    // Fixed poses come last.
    std::erase(bundle.keyframes_, view.origin());
    bundle.keyframes_.push_back(view.origin());
    problem.free_poses = static_cast<int>(bundle.keyframes_.size()) - 1;
    std::vector<std::pair<KeyFrameId, std::uint32_t>> place_of;
    for (const KeyFrameId id : bundle.keyframes_) {
      place_of.emplace_back(id, static_cast<std::uint32_t>(problem.T_cw.size()));
      problem.T_cw.push_back(view.keyframe(id)->T_cw);
    }
    std::sort(place_of.begin(), place_of.end());
    for (const MapPointId id : view.point_ids()) {
      const MapPoint& point = *view.point(id);
      if (point.observations.empty()) continue;
      const auto index = static_cast<std::uint32_t>(bundle.points_.size());
      bundle.points_.push_back(id);
      problem.p_w.push_back(point.p_w);
      for (const Observation& seen : point.observations) {
        const auto place = std::lower_bound(place_of.begin(), place_of.end(),
                                            std::make_pair(seen.keyframe, std::uint32_t{0}));
        const FeatureSet& features = *view.keyframe(seen.keyframe)->features;
        const KeyPoint& p = features.keypoint(seen.feature);
        problem.observations.push_back({place->second, index, p.u, p.v,
                                        p.has_depth() ? p.right_u : -1.0f,
                                        features.inv_sigma2(seen.feature)});
      }
    }
    return !problem.p_w.empty();
  });
  if (!usable) return std::nullopt;
  bundle.adjuster_ = std::make_unique<BundleAdjuster>(std::move(problem), options);
  return bundle;
}

MapDelta GlobalBundle::result(const Map& map) const {
  const BundleProblem& solved = adjuster_->problem();
  return map.read([&](const MapView& view) {
    MapCorrection correction;
    for (std::size_t i = 0; i < keyframes_.size(); ++i)
      if (const KeyFrame* keyframe = view.keyframe(keyframes_[i]))
        correction.move(keyframe->id, to_sim3(keyframe->T_cw), to_sim3(solved.T_cw[i]));
    for (std::size_t i = 0; i < points_.size(); ++i) correction.place(points_[i], solved.p_w[i]);
    return correction.delta(view);
  });
}

}  // namespace slambed
