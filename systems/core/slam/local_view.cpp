// SPDX-License-Identifier: Apache-2.0
#include "slam/local_view.hpp"

#include <algorithm>

namespace slambed {
namespace {

/// Covisibles tried per local keyframe (ORB-SLAM2).
constexpr std::size_t kNeighborsTried = 10;
/// Covisibles that gather_around() takes in.
constexpr std::size_t kNeighborsGathered = 10;

}  // namespace

void LocalView::vote(const MapView& view, Frame& frame) {
  ++round_;
  votes_.clear();
  for (std::size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i]) continue;
    const MapPoint* point = view.point(frame.points[i]);
    if (!point) {
      frame.points[i] = {};
      frame.outlier[i] = 0;
      continue;
    }
    for (const Observation& seen : point->observations) {
      if (seen.weight == 0) continue;
      KeyFrameMark& m = *keyframe_marks_.make(seen.keyframe);
      if (m.round != round_) {
        m = {round_, 0};
        votes_.push_back({seen.keyframe, 0});
      }
      ++m.votes;
    }
  }
  std::sort(votes_.begin(), votes_.end(), [](const Vote& a, const Vote& b) { return a.id < b.id; });
  for (Vote& v : votes_) v.count = keyframe_marks_.find(v.id)->votes;
}

void LocalView::gather_around(const Map& map, KeyFrameId keyframe) {
  map.read([&](const MapView& view) {
    const KeyFrame* middle = view.keyframe(keyframe);
    if (!middle) return 0;
    ++round_;
    votes_.clear();
    const auto add = [&](KeyFrameId id) {
      keyframe_marks_.make(id)->round = round_;
      votes_.push_back({id, 0});
    };
    add(keyframe);
    for (std::size_t n = 0; n < std::min(kNeighborsGathered, middle->covisibles.size()); ++n)
      add(middle->covisibles[n].id);
    collect(view);
    return 0;
  });
}

std::uint32_t LocalView::begin_look() {
  seen_.clear();
  return ++look_;
}

void LocalView::keep_observation_counts() {
  for (const PointObservation& s : seen_) {
    if (s.mark->visible == 0 && s.mark->found == 0) observed_.push_back(s.id);
    ++(s.found ? s.mark->found : s.mark->visible);
  }
  seen_.clear();
}

void LocalView::add_neighbors(const MapView& view) {
  const auto add = [&](KeyFrameId id) {
    if (!id || !view.keyframe(id)) return false;
    KeyFrameMark& m = *keyframe_marks_.make(id);
    if (m.round == round_) return false;
    m = {round_, 0};
    chosen_.push_back(id);
    return true;
  };
  // For each keyframe with votes: its best new covisible, one new child and its parent.
  const std::size_t voted = chosen_.size();
  for (std::size_t i = 0; i < voted && chosen_.size() <= kMaxKeyFrames; ++i) {
    const KeyFrame& keyframe = *view.keyframe(chosen_[i]);
    const std::size_t tried = std::min(kNeighborsTried, keyframe.covisibles.size());
    for (std::size_t n = 0; n < tried; ++n)
      if (add(keyframe.covisibles[n].id)) break;
    for (const KeyFrameId child : keyframe.children)
      if (add(child)) break;
    add(keyframe.parent);
  }
}

bool LocalView::collect(const MapView& view) {
  chosen_.clear();
  for (const Vote& v : votes_) chosen_.push_back(v.id);
  add_neighbors(view);
  if (view.revision() == revision_ && chosen_ == keyframes_) return false;
  revision_ = view.revision();
  keyframes_ = chosen_;
  points_.clear();
  marks_of_points_.clear();
  ++copy_;
  for (const KeyFrameId id : keyframes_) {
    for (const MapPointId point_id : view.keyframe(id)->points) {
      if (!point_id) continue;
      Mark& m = *marks_.make(point_id);
      if (m.collected == copy_) continue;
      m.collected = copy_;
      const MapPoint& point = *view.point(point_id);
      points_.push_back({point_id, point.p_w, point.appearance.normal,
                         point.appearance.min_distance_m, point.appearance.max_distance_m,
                         point.appearance.descriptor});
      marks_of_points_.push_back(&m);
    }
  }
  return true;
}

std::vector<PointObservationCounts> LocalView::take_observation_counts(const Map& map) {
  std::sort(observed_.begin(), observed_.end());
  std::vector<PointObservationCounts> observation_counts;
  observation_counts.reserve(observed_.size());
  map.read([&](const MapView& view) {
    for (const MapPointId id : observed_) {
      Mark& m = *marks_.find(id);
      if (const MapPoint* point = view.point(id))
        observation_counts.push_back({id, point->visible + m.visible, point->found + m.found});
      m.visible = m.found = 0;
    }
    return 0;
  });
  observed_.clear();
  return observation_counts;
}

void LocalView::clear() {
  keyframe_marks_.clear();
  votes_.clear();
  chosen_.clear();
  keyframes_.clear();
  revision_ = 0;
  points_.clear();
  marks_of_points_.clear();
  marks_.clear();
  seen_.clear();
  observed_.clear();
}

}  // namespace slambed
