// SPDX-License-Identifier: Apache-2.0
#include "slam/point_merging.hpp"

#include <algorithm>

#include "map/appearance.hpp"
#include "optimize/pose_optimizer.hpp"

namespace slambed {
namespace {

/// Window at octave 0 (ORB-SLAM2, px).
constexpr float kRadius_px = 3;
constexpr float kChi2MonoFusion = 5.99f, kChi2StereoFusion = 7.8f;  ///< as ORB-SLAM2 rounds them
constexpr int kWordBits = 64;

bool bit(const std::vector<std::uint64_t>& words, int i) {
  return (words[i / kWordBits] >> (i % kWordBits)) & 1;
}
void set_bit(std::vector<std::uint64_t>& words, int i) {
  words[i / kWordBits] |= std::uint64_t{1} << (i % kWordBits);
}

}  // namespace

bool PointMerging::copy(const Map& map, KeyFrameId keyframe, int neighbors, int second_neighbors) {
  keyframes_.clear();
  points_.clear();
  ++run_;
  map.read([&](const MapView& view) {
    const KeyFrame* current = view.keyframe(keyframe);
    if (!current) return 0;
    keyframes_.push_back(copy_of(*current));
    const auto add = [&](KeyFrameId id) {
      for (const KeyFrameCopy& known : keyframes_)
        if (known.id == id) return;
      keyframes_.push_back(copy_of(*view.keyframe(id)));
    };
    const auto first = best_covisibles(*current, neighbors);
    for (const KeyFrameId id : first) add(id);
    for (const KeyFrameId id : first)
      for (const KeyFrameId further : best_covisibles(*view.keyframe(id), second_neighbors))
        add(further);
    const std::size_t words = (keyframes_.size() + kWordBits - 1) / kWordBits;
    slots_.resize(keyframes_.size());
    for (std::size_t k = 0; k < keyframes_.size(); ++k) {
      const auto& ids = keyframes_[k].points;
      slots_[k].assign(ids.size(), -1);
      for (std::size_t i = 0; i < ids.size(); ++i) {
        if (!ids[i]) continue;
        Place& place = *places_.make(ids[i]);
        if (place.run != run_) {
          place = {run_, static_cast<int>(points_.size())};
          const MapPoint& point = *view.point(ids[i]);
          points_.push_back(
              {{point.id, point.p_w, point.appearance.normal, point.appearance.min_distance_m,
                point.appearance.max_distance_m, point.appearance.descriptor},
               point.weight,
               -1,
               std::vector<std::uint64_t>(words)});
        }
        set_bit(points_[place.index].seen, static_cast<int>(k));
        slots_[k][i] = place.index;
      }
    }
    return 0;
  });
  return keyframes_.size() > 1;
}

int PointMerging::alive(int point) const {
  while (points_[point].survivor >= 0) point = points_[point].survivor;
  return point;
}

void PointMerging::attach(int keyframe, int feature, int point, MapDelta& delta) {
  delta.attach.push_back(
      {keyframes_[keyframe].id, static_cast<std::uint16_t>(feature), points_[point].sketch.id});
  slots_[keyframe][feature] = point;
  set_bit(points_[point].seen, keyframe);
  points_[point].weight += keyframes_[keyframe].features->keypoint(feature).right_u >= 0 ? 2 : 1;
}

void PointMerging::fuse(int gone, int survivor, MapDelta& delta) {
  delta.fusions.push_back({points_[gone].sketch.id, points_[survivor].sketch.id});
  Point& g = points_[gone];
  Point& s = points_[survivor];
  g.survivor = survivor;
  // Adds the share of g's weight whose keyframes do not see s yet, estimated from the copy.
  int shared = 0, moved = 0;
  for (std::size_t w = 0; w < g.seen.size(); ++w) {
    shared += std::popcount(g.seen[w] & s.seen[w]);
    moved += std::popcount(g.seen[w]);
  }
  s.weight += moved > 0 ? g.weight * (moved - shared) / moved : g.weight;
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    if (!bit(g.seen, static_cast<int>(k))) continue;
    const bool had = bit(s.seen, static_cast<int>(k));
    for (int& slot : slots_[k])
      if (slot == gone) slot = had ? -1 : survivor;
    set_bit(s.seen, static_cast<int>(k));
  }
}

void PointMerging::project_into(int keyframe, std::span<const int> points, MapDelta& delta) {
  const KeyFrameCopy& target = keyframes_[keyframe];
  const FeatureSet& features = *target.features;
  const ScalePyramid& pyramid = features.sensor().pyramid;
  const Viewpoint camera(features.sensor(), target.T_cw);
  for (const int listed : points) {
    if (points_[listed].survivor >= 0) continue;  // fused meanwhile
    const Point& point = points_[listed];
    if (bit(point.seen, keyframe)) continue;
    Matcher::Query query;
    if (!camera.sees(point.sketch, query.at)) continue;
    const int octave = predict_octave(point.sketch.max_distance_m, query.at.distance_m, pyramid);
    query.radius_px = kRadius_px * pyramid.scale[octave];
    query.min_octave = std::max(0, octave - 1);
    query.max_octave = octave;
    query.descriptor = &point.sketch.descriptor;
    const Matcher::Best best = matcher_.search(features, query, [&](int feature) {
      const KeyPoint& seen = features.keypoint(feature);
      const float du = seen.u - query.at.u, dv = seen.v - query.at.v;
      float e2 = du * du + dv * dv, limit = kChi2MonoFusion;
      if (seen.right_u >= 0) {
        const float right = seen.right_u - query.at.right_u;
        e2 += right * right;
        limit = kChi2StereoFusion;
      }
      return e2 * features.inv_sigma2(feature) <= limit;
    });
    if (best.distance > kHammingLow) continue;
    const int other = slots_[keyframe][best.feature];
    if (other < 0) {
      attach(keyframe, best.feature, listed, delta);
    } else if (points_[other].weight > point.weight) {
      fuse(listed, other, delta);
    } else {
      fuse(other, listed, delta);
    }
  }
}

MapDelta PointMerging::run(const Map& map, KeyFrameId keyframe, int neighbors,
                           int second_neighbors) {
  MapDelta delta;
  delta.epoch = map.read([](const MapView& view) { return view.epoch(); });
  if (!copy(map, keyframe, neighbors, second_neighbors)) return delta;
  std::vector<int> own;
  for (const int point : slots_[0])
    if (point >= 0) own.push_back(point);
  for (std::size_t k = 1; k < keyframes_.size(); ++k) project_into(static_cast<int>(k), own, delta);

  std::vector<int> theirs;
  std::vector<std::uint8_t> listed(points_.size());
  for (std::size_t k = 1; k < keyframes_.size(); ++k) {
    for (const int point : slots_[k]) {
      if (point < 0 || listed[point]) continue;
      listed[point] = 1;
      theirs.push_back(point);
    }
  }
  project_into(0, theirs, delta);
  return delta;
}

}  // namespace slambed
