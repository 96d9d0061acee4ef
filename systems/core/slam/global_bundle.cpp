// SPDX-License-Identifier: Apache-2.0
#include "slam/global_bundle.hpp"

#include <algorithm>
#include <utility>

#include "map/read_in_parts.hpp"
#include "slam/map_correction.hpp"

namespace slambed {

WholeMap collect(const Map& map) {
  WholeMap whole;
  BundleProblem& problem = whole.problem;
  KeyFrameId origin;
  std::vector<KeyFrameId> keyframes;
  std::vector<MapPointId> points;
  map.read([&](const MapView& view) {
    origin = view.origin();
    keyframes = view.keyframe_ids();
    points = view.point_ids();
  });
  // Fixed poses come last.
  std::erase(keyframes, origin);
  keyframes.push_back(origin);
  std::vector<std::pair<KeyFrameId, std::uint32_t>> place_of;
  read_in_parts(map, keyframes, [&](const MapView& view, KeyFrameId id) {
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) return;
    problem.camera = keyframe->features->sensor().camera;
    place_of.emplace_back(id, static_cast<std::uint32_t>(problem.T_cw.size()));
    problem.T_cw.push_back(keyframe->T_cw);
    whole.keyframes.push_back(id);
  });
  if (whole.keyframes.size() < 2 || whole.keyframes.back() != origin) return {};
  problem.free_poses = static_cast<int>(whole.keyframes.size()) - 1;
  std::sort(place_of.begin(), place_of.end());
  read_in_parts(map, points, [&](const MapView& view, MapPointId id) {
    const MapPoint* point = view.point(id);
    if (!point) return;
    const auto index = static_cast<std::uint32_t>(whole.points.size());
    const std::size_t before = problem.observations.size();
    for (const Observation& seen : point->observations) {
      const auto place = std::lower_bound(place_of.begin(), place_of.end(),
                                          std::make_pair(seen.keyframe, std::uint32_t{0}));
      if (place == place_of.end() || place->first != seen.keyframe) continue;  // added meanwhile
      const FeatureSet& features = *view.keyframe(seen.keyframe)->features;
      const KeyPoint& p = features.keypoint(seen.feature);
      problem.observations.push_back({place->second, index, p.u, p.v,
                                      p.has_depth() ? p.right_u : -1.0f,
                                      features.inv_sigma2(seen.feature)});
    }
    if (problem.observations.size() == before) return;
    whole.points.push_back(id);
    problem.p_w.push_back(point->p_w);
  });
  return whole;
}

std::optional<GlobalBundle> GlobalBundle::of(const Map& map, const BundleOptions& options) {
  WholeMap whole = collect(map);
  if (whole.points.empty()) return std::nullopt;
  GlobalBundle bundle;
  bundle.keyframes_ = std::move(whole.keyframes);
  bundle.points_ = std::move(whole.points);
  bundle.adjuster_ = std::make_unique<BundleAdjuster>(std::move(whole.problem), options);
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
