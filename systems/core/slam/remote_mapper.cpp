// SPDX-License-Identifier: Apache-2.0
#include "slam/remote_mapper.hpp"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace slambed {
namespace {

constexpr IdSpace kPrior = IdSpace::kEdgeMapper, kTrip = IdSpace::kTracker;
/// Minimum cosine of the angle between two cameras that can see the same points (60 degrees).
constexpr double kLeastCommonView = 0.5;

}  // namespace

RemoteMapper::RemoteMapper(RemoteMapperOptions options, std::shared_ptr<Map> map,
                           std::shared_ptr<PlaceIndex> places)
    : options_(options),
      map_(std::move(map)),
      places_(std::move(places)),
      verifier_(options.verifier, places_) {}

std::vector<KeyFrameId> RemoteMapper::candidates(const BagOfWords& bag, const NewKeyFrame& keyframe,
                                                 bool estimated) const {
  std::vector<KeyFrameId> chosen = places_->candidates(bag, *map_);
  if (std::ssize(chosen) > options_.place_candidates)
    chosen.resize(static_cast<std::size_t>(options_.place_candidates));
  if (!estimated) return chosen;
  return map_->read([&](const MapView& view) {
    const SE3 T_wc = keyframe.T_cw.inverse();
    std::vector<std::pair<double, KeyFrameId>> near;
    for (const KeyFrameId id : view.keyframe_ids()) {
      if (!made_by(id, kPrior)) continue;
      const SE3& T_cw = view.keyframe(id)->T_cw;
      const double distance_m = (T_cw * T_wc.t).norm();  // seen from the other camera
      if (distance_m > options_.search_radius_m) continue;
      if (T_cw.R.row(2).dot(T_wc.R.col(2).transpose()) < kLeastCommonView) continue;
      near.emplace_back(distance_m, id);
    }
    std::sort(near.begin(), near.end());
    for (const auto& [distance_m, id] : near) {
      if (std::ssize(chosen) >= options_.place_candidates + options_.near_candidates) break;
      if (std::find(chosen.begin(), chosen.end(), id) == chosen.end()) chosen.push_back(id);
    }
    return chosen;
  });
}

RemoteMapper::Match RemoteMapper::match(const MapDelta& received, bool estimated) {
  const NewKeyFrame& keyframe = received.keyframes.front();
  const BagOfWords bag = places_->vocabulary().transform(keyframe.features->descriptors());
  Match match;
  for (const KeyFrameId candidate : candidates(bag, keyframe, estimated)) {
    ++match.tried;
    const auto found = verifier_.verify(*map_, received, bag, candidate);
    if (!found) continue;
    match.matched = candidate;
    match.matches = found->matches;
    match.delta = joined(received, *found);
    break;
  }
  return match;
}

/// Returns the keyframe at its place in the global map. It shares the map's points that it sees.
/// Its other points are added at the vehicle's positions relative to the keyframe.
MapDelta RemoteMapper::joined(const MapDelta& received, const LoopMatch& match) const {
  MapDelta delta;
  delta.keyframes.push_back(received.keyframes.front());
  NewKeyFrame& keyframe = delta.keyframes.front();
  const SE3 T_cw = to_se3(match.S_cw);
  const SE3 T_new_old = (T_cw.inverse() * keyframe.T_cw).normalized();
  keyframe.T_cw = T_cw;
  keyframe.parent = {};
  std::unordered_map<MapPointId, const NewPoint*> by_id;
  for (const NewPoint& point : received.points) by_id.emplace(point.id, &point);
  return map_->read([&](const MapView& view) {
    delta.epoch = view.epoch();
    std::unordered_set<MapPointId> seen;
    for (std::size_t i = 0; i < keyframe.points.size(); ++i) {
      const MapPointId own = std::exchange(keyframe.points[i], {});
      const MapPointId old = match.points[i];
      const MapPointId known = own ? view.resolve(own) : MapPointId{};
      const auto sent = by_id.find(own);
      const MapPointId chosen = old ? old : known ? known : sent != by_id.end() ? own : old;
      if (!chosen || !seen.insert(chosen).second) continue;
      keyframe.points[i] = chosen;
      if (!known && sent != by_id.end()) {
        NewPoint point = *sent->second;
        point.p_w = T_new_old * point.p_w;
        point.appearance.normal = T_new_old.R.cast<float>() * point.appearance.normal;
        point.reference = point.first_keyframe = keyframe.id;
        delta.points.push_back(point);
      }
      // The trip's point is one of an earlier trip, so it is fused with that for all keyframes that
      // name it.
      const MapPointId mine = known ? known : sent != by_id.end() ? own : MapPointId{};
      if (old && mine && mine != old && !made_by(mine, kPrior))
        delta.fusions.push_back({mine, old});
    }
    return delta;
  });
}

bool RemoteMapper::begin_bundle(KeyFrameId keyframe) {
  window_ = BundleWindow::around(*map_, keyframe, options_.bundle, scratch_, {.movable = kTrip});
  return window_.has_value();
}

bool RemoteMapper::step_bundle() { return window_ && window_->step(); }

std::size_t RemoteMapper::bundle_observations() const {
  return window_ ? window_->observations() : 0;
}

MapDelta RemoteMapper::finish_bundle() {
  if (!window_) return {};
  MapDelta delta = window_->result();
  window_.reset();
  return delta;
}

}  // namespace slambed
