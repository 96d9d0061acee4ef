// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/local_map.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace slambed::edgeslam_semantic {
namespace {

constexpr std::size_t kLeastForScale = 15;
constexpr double kScaleTolerance = 0.005;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Builds the delta. Each point is added once, with the first keyframe that sees it.
class Composer {
 public:
  Composer(const MapView& before, const LocalMapParts& parts) : before_(before), parts_(parts) {
    for (const auto& [id, observed] : parts_.window.keyframes) note_renamed(id, observed);
  }

  MapDelta compose() {
    std::set<MapPointId> kept;
    std::vector<const KeyFrame*> newer;
    for (const KeyFrameId id : before_.keyframe_ids()) {
      if (id <= parts_.newest || parts_.window.keyframes.contains(id)) continue;
      newer.push_back(before_.keyframe(id));
      for (const MapPointId point : newer.back()->points)
        if (stays(point)) kept.insert(point);
    }
    for (const auto& [id, observed] : parts_.window.keyframes) add(id, observed, kept);
    for (const KeyFrame* keyframe : newer) add(*keyframe);
    return std::move(delta_);
  }

 private:
  /// Notes own points that the window replaces by another point at the same feature.
  void note_renamed(KeyFrameId id, const MapWindow::ObservedKeyFrame& observed) {
    const KeyFrame* known = before_.keyframe(id);
    if (!known) return;
    for (const auto& [feature, point] : observed.points) {
      if (feature >= known->points.size()) continue;
      const MapPointId was = known->points[feature];
      if (was && was != point && !parts_.window.points.contains(was)) renamed_[was] = point;
    }
  }

  bool stays(MapPointId point) const {
    return point && !parts_.window.points.contains(point) && !renamed_.contains(point) &&
           !parts_.gone.contains(point);
  }

  MapPointId now(MapPointId point) const {
    if (const auto other = renamed_.find(point); other != renamed_.end()) point = other->second;
    return parts_.gone.contains(point) ? MapPointId{} : point;
  }

  void add(KeyFrameId id, const MapWindow::ObservedKeyFrame& observed,
           const std::set<MapPointId>& kept) {
    const auto own = parts_.own.find(id);
    if (own == parts_.own.end()) return;
    const OwnKeyFrame& mine = own->second;
    std::vector<MapPointId> points(static_cast<std::size_t>(mine.features->size()));
    for (const auto& [feature, point] : observed.points)
      if (feature < points.size() && !parts_.gone.contains(point)) points[feature] = point;
    if (const KeyFrame* known = before_.keyframe(id)) {
      for (std::size_t i = 0; i < points.size() && i < known->points.size(); ++i)
        if (!points[i] && kept.contains(known->points[i])) points[i] = known->points[i];
    }
    put({.id = id,
         .frame_index = mine.frame_index,
         .timestamp_s = mine.timestamp_s,
         .features = mine.features,
         .T_cw = observed.T_cw,
         .points = std::move(points),
         .parent = {}});
  }

  void add(const KeyFrame& keyframe) {
    std::vector<MapPointId> points(keyframe.points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
      if (keyframe.points[i]) points[i] = now(keyframe.points[i]);
    put({.id = keyframe.id,
         .frame_index = keyframe.frame_index,
         .timestamp_s = keyframe.timestamp_s,
         .features = keyframe.features,
         .T_cw = to_se3(normalized(to_sim3(keyframe.T_cw) * parts_.S_new_old.inverse())),
         .points = std::move(points),
         .parent = {}});
  }

  void put(NewKeyFrame keyframe) {
    for (MapPointId& id : keyframe.points) {
      if (!id || placed_.contains(id)) continue;
      const auto in_window = parts_.window.points.find(id);
      const MapPoint* mine = before_.point(id);
      if (in_window == parts_.window.points.end() && !mine) {
        id = {};
        continue;
      }
      NewPoint point;
      point.id = id;
      point.p_w = in_window != parts_.window.points.end() ? in_window->second
                                                          : parts_.S_new_old * mine->p_w;
      point.reference = point.first_keyframe = keyframe.id;
      placed_.insert(id);
      delta_.points.push_back(point);
    }
    delta_.keyframes.push_back(std::move(keyframe));
  }

  const MapView& before_;
  const LocalMapParts& parts_;
  std::map<MapPointId, MapPointId> renamed_;
  std::set<MapPointId> placed_;
  MapDelta delta_;
};

}  // namespace

void forget_left(std::map<KeyFrameId, OwnKeyFrame>& own, const MapWindow& window,
                 KeyFrameId newest) {
  if (window.keyframes.empty()) return;
  std::erase_if(own, [&](const auto& entry) {
    return entry.first <= newest && !window.keyframes.contains(entry.first);
  });
}

Sim3 correction_at(const MapView& rough, KeyFrameId keyframe, const MapWindow& optimized) {
  const auto now = optimized.keyframes.find(keyframe);
  const KeyFrame* was = rough.keyframe(keyframe);
  if (now == optimized.keyframes.end() || !was) return to_sim3(SE3());
  const SE3 T_wc_old = was->T_cw.inverse(), T_wc_new = now->second.T_cw.inverse();
  std::vector<double> ratios;
  for (const auto& [feature, id] : now->second.points) {
    const MapPoint* point = rough.point(id);
    if (!point) continue;
    const double before_m = (point->p_w - T_wc_old.t).norm();
    if (before_m > 0) ratios.push_back((optimized.points.at(id) - T_wc_new.t).norm() / before_m);
  }
  double scale = ratios.size() < kLeastForScale ? 1 : median(ratios);
  if (!(std::abs(scale - 1) > kScaleTolerance)) scale = 1;
  const Eigen::Matrix3d R = now->second.T_cw.R.transpose() * was->T_cw.R;
  return normalized({scale, R, T_wc_new.t - scale * (R * T_wc_old.t)});
}

MapDelta local_map(const MapView& before, const LocalMapParts& parts) {
  return Composer(before, parts).compose();
}

}  // namespace slambed::edgeslam_semantic
