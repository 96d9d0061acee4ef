// SPDX-License-Identifier: Apache-2.0
#include "slam/loop_verifier.hpp"

#include <algorithm>
#include <unordered_map>

#include "map/appearance.hpp"
#include "optimize/sim3_solver.hpp"
#include "slam/word_matching.hpp"

namespace slambed {
namespace {

/// Projects a point in the camera frame; false if behind the camera or outside the image.
bool project_local(const Sensor& sensor, const Eigen::Vector3d& p_c, Projection& out) {
  return Viewpoint(sensor, SE3()).project(p_c, out);
}

PointSketch sketch_of(const MapPoint& point) {
  return {point.id,
          point.p_w,
          point.appearance.normal,
          point.appearance.min_distance_m,
          point.appearance.max_distance_m,
          point.appearance.descriptor};
}

}  // namespace

std::vector<PointSketch> sketch_points(const MapView& view, std::span<const MapPointId> ids) {
  std::vector<PointSketch> sketches;
  sketches.reserve(ids.size());
  for (const MapPointId id : ids)
    if (const MapPoint* point = view.point(id)) sketches.push_back(sketch_of(*point));
  return sketches;
}

bool LoopVerifier::copy(const MapView& view, KeyFrameId id, Side& side) {
  const KeyFrame* k = view.keyframe(id);
  if (!k) return false;
  side.keyframe = copy_of(*k);
  side.points.clear();
  side.of_feature.assign(k->points.size(), -1);
  side.has_point.assign(k->points.size(), 0);
  for (std::size_t i = 0; i < k->points.size(); ++i) {
    const MapPoint* point = k->points[i] ? view.point(k->points[i]) : nullptr;
    if (!point) continue;
    side.of_feature[i] = static_cast<int>(side.points.size());
    side.has_point[i] = 1;
    side.points.push_back(sketch_of(*point));
  }
  return true;
}

LoopVerifier::Side LoopVerifier::side_of(const MapDelta& fresh) {
  const NewKeyFrame& k = fresh.keyframes.front();
  std::unordered_map<MapPointId, const NewPoint*> points;
  for (const NewPoint& point : fresh.points) points.emplace(point.id, &point);
  Side side;
  side.keyframe = {k.id, k.features, k.T_cw, k.points};
  side.of_feature.assign(k.points.size(), -1);
  side.has_point.assign(k.points.size(), 0);
  for (std::size_t i = 0; i < k.points.size(); ++i) {
    const auto point = points.find(k.points[i]);
    if (point == points.end()) continue;
    side.of_feature[i] = static_cast<int>(side.points.size());
    side.has_point[i] = 1;
    const Appearance& looks = point->second->appearance;
    side.points.push_back({point->first, point->second->p_w, looks.normal, looks.min_distance_m,
                           looks.max_distance_m, looks.descriptor});
  }
  return side;
}

bool LoopVerifier::copy_loop_points(const Map& map, KeyFrameId candidate) {
  return map.read([&](const MapView& view) {
    const KeyFrame* old = view.keyframe(candidate);
    if (!old) return false;
    std::vector<MapPointId> ids;
    const auto gather = [&](const KeyFrame& k) {
      for (const MapPointId id : k.points)
        if (id) ids.push_back(id);
    };
    gather(*old);
    for (const Covisible& near : old->covisibles) gather(*view.keyframe(near.id));
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    loop_points_ = sketch_points(view, ids);
    return true;
  });
}

bool LoopVerifier::estimate(Pairs& pairs, Sim3& S_12, bool from_scratch) const {
  const FeatureSet &ours = *current_.keyframe.features, &theirs = *matched_.keyframe.features;
  std::vector<Sim3Match> matches;
  matches.reserve(pairs.size());
  for (const auto& [i, j] : pairs) {
    const KeyPoint &a = ours.keypoint(i), &b = theirs.keypoint(j);
    matches.push_back({current_.keyframe.T_cw * current_.points[current_.of_feature[i]].p_w,
                       matched_.keyframe.T_cw * matched_.points[matched_.of_feature[j]].p_w, a.u,
                       a.v, b.u, b.v, ours.inv_sigma2(i), theirs.inv_sigma2(j)});
  }
  Sim3Options options;
  options.fix_scale = ours.sensor().metric();
  Sim3Result result;
  if (from_scratch) {
    auto found = solve_sim3_ransac(ours.sensor().camera, matches, options);
    if (!found) return false;
    result = std::move(*found);
  } else {
    result = refine_sim3(ours.sensor().camera, matches, S_12, options);
  }
  if (result.inliers < options_.least_matches) return false;
  S_12 = result.S_12;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (result.inlier[k]) pairs[kept++] = pairs[k];
  pairs.resize(kept);
  return true;
}

/// Returns per feature of `from` the feature of `into` that best matches its point, or -1.
std::vector<int> LoopVerifier::project(const Side& from, const Side& into, const Sim3& S_into_from,
                                       std::span<const std::uint8_t> taken_from,
                                       std::span<const std::uint8_t> taken_into) {
  const FeatureSet& features = *into.keyframe.features;
  const Sensor& sensor = features.sensor();
  std::vector<int> found(from.of_feature.size(), -1);
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (from.of_feature[i] < 0 || taken_from[i]) continue;
    const PointSketch& point = from.points[from.of_feature[i]];
    const Eigen::Vector3d p = S_into_from * (from.keyframe.T_cw * point.p_w);
    Matcher::Query query;
    if (!project_local(sensor, p, query.at)) continue;
    // Compares distances in the scale of the point's own side.
    const auto distance_m = static_cast<float>(p.norm() / S_into_from.scale);
    if (distance_m < kNearest * point.min_distance_m ||
        distance_m > kFarthest * point.max_distance_m)
      continue;
    const int octave = predict_octave(point.max_distance_m, distance_m, sensor.pyramid);
    query.radius_px = options_.pair_radius_px * sensor.pyramid.scale[octave];
    query.min_octave = std::max(0, octave - 1);
    query.max_octave = octave;
    query.descriptor = &point.descriptor;
    const Matcher::Best best =
        matcher_.search(features, query, [&](int feature) { return !taken_into[feature]; });
    if (best.distance <= kHammingHigh) found[i] = best.feature;
  }
  return found;
}

/// Adds pairs that match in both directions under the current similarity.
void LoopVerifier::add_pairs(const Sim3& S_12, Pairs& pairs) {
  std::vector<std::uint8_t> taken_1(current_.of_feature.size()),
      taken_2(matched_.of_feature.size());
  for (const auto& [i, j] : pairs) taken_1[i] = taken_2[j] = 1;
  const auto in_2 = project(current_, matched_, S_12.inverse(), taken_1, taken_2);
  const auto in_1 = project(matched_, current_, S_12, taken_2, taken_1);
  for (int i = 0; i < static_cast<int>(in_2.size()); ++i)
    if (in_2[i] >= 0 && in_1[in_2[i]] == i) pairs.emplace_back(i, in_2[i]);
}

/// Looks for all points of the old part in the new keyframe.
void LoopVerifier::add_points(LoopMatch& match) {
  const FeatureSet& features = *current_.keyframe.features;
  const Sensor& sensor = features.sensor();
  const Viewpoint camera(sensor, to_se3(match.S_cw));
  std::vector<MapPointId> known;
  for (const MapPointId id : match.points)
    if (id) known.push_back(id);
  std::sort(known.begin(), known.end());
  for (const PointSketch& point : loop_points_) {
    match.loop_points.push_back(point.id);
    if (std::binary_search(known.begin(), known.end(), point.id)) continue;
    Matcher::Query query;
    if (!camera.sees(point, query.at)) continue;
    const int octave = predict_octave(point.max_distance_m, query.at.distance_m, sensor.pyramid);
    query.radius_px = options_.points_radius_px * sensor.pyramid.scale[octave];
    query.min_octave = std::max(0, octave - 1);
    query.max_octave = octave;
    query.descriptor = &point.descriptor;
    const Matcher::Best best =
        matcher_.search(features, query, [&](int feature) { return !match.points[feature]; });
    if (best.distance > kHammingLow) continue;
    match.points[best.feature] = point.id;
    ++match.matches;
  }
}

std::optional<LoopMatch> LoopVerifier::verify(const Map& map, KeyFrameId keyframe,
                                              KeyFrameId candidate) {
  const auto bag = places_->bag(keyframe), candidate_bag = places_->bag(candidate);
  const bool there = bag && candidate_bag && map.read([&](const MapView& view) {
    return copy(view, keyframe, current_) && copy(view, candidate, matched_);
  });
  return there ? compare(map, *bag, *candidate_bag) : std::nullopt;
}

std::optional<LoopMatch> LoopVerifier::verify(const Map& map, const MapDelta& fresh,
                                              const BagOfWords& bag, KeyFrameId candidate) {
  const auto candidate_bag = places_->bag(candidate);
  const bool there = candidate_bag &&
                     map.read([&](const MapView& view) { return copy(view, candidate, matched_); });
  if (!there) return std::nullopt;
  current_ = side_of(fresh);
  return compare(map, bag, *candidate_bag);
}

std::optional<LoopMatch> LoopVerifier::compare(const Map& map, const BagOfWords& bag,
                                               const BagOfWords& candidate_bag) {
  Pairs pairs = match_by_words({*current_.keyframe.features, bag, current_.has_point},
                               {*matched_.keyframe.features, candidate_bag, matched_.has_point},
                               options_.word_ratio);
  Sim3 S_12;
  if (static_cast<int>(pairs.size()) < options_.least_matches || !estimate(pairs, S_12, true))
    return std::nullopt;
  add_pairs(S_12, pairs);
  if (!estimate(pairs, S_12, false) || !copy_loop_points(map, matched_.keyframe.id))
    return std::nullopt;

  LoopMatch match;
  match.keyframe = current_.keyframe.id;
  match.matched = matched_.keyframe.id;
  match.S_cw = normalized(S_12 * to_sim3(matched_.keyframe.T_cw));
  match.points.resize(current_.of_feature.size());
  for (const auto& [i, j] : pairs) match.points[i] = matched_.points[matched_.of_feature[j]].id;
  match.matches = static_cast<int>(pairs.size());
  add_points(match);
  if (match.matches < options_.least_total) return std::nullopt;
  return match;
}

}  // namespace slambed
