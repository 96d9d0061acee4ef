// SPDX-License-Identifier: Apache-2.0
#include "slam/frame_search.hpp"

#include <algorithm>

#include "map/appearance.hpp"

namespace slambed {
namespace {

/// Search radius at octave 0 for points seen almost head-on and for all others (ORB-SLAM2).
constexpr float kHeadOnRadius_px = 2.5f, kObliqueRadius_px = 4.0f;
constexpr float kHeadOnCosine = 0.998f;
/// Maximum ratio of best to second-best distance if both are on the same octave.
constexpr float kLocalRatio = 0.8f;

}  // namespace

void copy_seen_points(const Map& map, KeyFrameId keyframe_id, std::vector<SeenPoint>& out) {
  out.clear();
  map.read([&](const MapView& view) {
    const KeyFrame* keyframe = view.keyframe(keyframe_id);
    if (!keyframe) return 0;
    for (std::size_t i = 0; i < keyframe->points.size(); ++i) {
      const MapPoint* point = keyframe->points[i] ? view.point(keyframe->points[i]) : nullptr;
      if (!point) continue;
      const KeyPoint& seen = keyframe->features->keypoint(static_cast<int>(i));
      out.push_back({point->id, point->p_w, point->appearance.descriptor, seen.angle_deg,
                     seen.octave, point->appearance.min_distance_m,
                     point->appearance.max_distance_m});
    }
    return 0;
  });
}

int FrameSearch::match_last_frame(std::span<const SeenPoint> points, const SE3& T_lw,
                                  float radius_px, Frame& frame) {
  frame.clear_matches();
  rotation_.clear();
  const FeatureSet& features = *frame.features;
  const Sensor& sensor = features.sensor();
  const Viewpoint camera(sensor, frame.T_cw);
  const double forward_m = (T_lw * camera.center()).z();
  // A monocular map has no metric scale to compare with the baseline.
  const bool forward = sensor.metric() && forward_m > sensor.camera.baseline_m();
  const bool backward = sensor.metric() && -forward_m > sensor.camera.baseline_m();
  const int top = sensor.pyramid.levels() - 1;
  int matches = 0;
  for (const SeenPoint& point : points) {
    Matcher::Query query;
    if (!camera.project(point.p_w, query.at)) continue;
    query.radius_px = radius_px * sensor.pyramid.scale[point.octave];
    query.min_octave = backward ? 0 : forward ? point.octave : std::max(0, point.octave - 1);
    query.max_octave = forward ? top : backward ? point.octave : std::min(top, point.octave + 1);
    query.descriptor = &point.descriptor;
    const Matcher::Best best =
        matcher_.search(features, query, [&](int feature) { return !frame.points[feature]; });
    if (best.distance > kHammingHigh) continue;
    frame.match(best.feature, point.id, point.p_w);
    rotation_.add(point.angle_deg, features.keypoint(best.feature).angle_deg, best.feature);
    ++matches;
  }
  for (const int feature : rotation_.disagreeing()) {
    frame.points[feature] = {};
    --matches;
  }
  return matches;
}

int FrameSearch::match_by_descriptor(std::span<const SeenPoint> points, float ratio, Frame& frame) {
  frame.clear_matches();
  seen_.clear();
  for (const SeenPoint& point : points) seen_.push_back({&point.descriptor, point.angle_deg});
  const auto matches = matcher_.match_all(seen_, *frame.features, ratio);
  for (const auto& [p, feature] : matches) frame.match(feature, points[p].id, points[p].p_w);
  return static_cast<int>(matches.size());
}

int FrameSearch::add_projected(std::span<const SeenPoint> points, float radius_px, int max_distance,
                               Frame& frame) {
  rotation_.clear();
  known_.clear();
  for (const MapPointId id : frame.points)
    if (id) known_.push_back(id);
  std::sort(known_.begin(), known_.end());
  const FeatureSet& features = *frame.features;
  const ScalePyramid& pyramid = features.sensor().pyramid;
  const Viewpoint camera(features.sensor(), frame.T_cw);
  int added = 0;
  for (const SeenPoint& point : points) {
    Matcher::Query query;
    if (std::binary_search(known_.begin(), known_.end(), point.id)) continue;
    if (!camera.project(point.p_w, query.at)) continue;
    const auto distance_m = static_cast<float>((point.p_w - camera.center()).norm());
    if (distance_m < kNearest * point.min_distance_m ||
        distance_m > kFarthest * point.max_distance_m)
      continue;
    const int octave = predict_octave(point.max_distance_m, distance_m, pyramid);
    query.radius_px = radius_px * pyramid.scale[octave];
    query.min_octave = std::max(0, octave - 1);
    query.max_octave = std::min(pyramid.levels() - 1, octave + 1);
    query.descriptor = &point.descriptor;
    const Matcher::Best best =
        matcher_.search(features, query, [&](int feature) { return !frame.points[feature]; });
    if (best.distance > max_distance) continue;
    frame.match(best.feature, point.id, point.p_w);
    rotation_.add(point.angle_deg, features.keypoint(best.feature).angle_deg, best.feature);
    ++added;
  }
  for (const int feature : rotation_.disagreeing()) {
    frame.points[feature] = {};
    --added;
  }
  return added;
}

int FrameSearch::add_local(LocalView& local, float radius_factor, Frame& frame) {
  const std::uint32_t look = local.begin_look();
  for (const MapPointId id : frame.points) {
    if (!id) continue;
    local.count_visible(id);
    if (LocalView::Mark* mark = local.mark(id)) mark->look = look;
  }
  const FeatureSet& features = *frame.features;
  const ScalePyramid& pyramid = features.sensor().pyramid;
  const Viewpoint camera(features.sensor(), frame.T_cw);
  const auto points = local.points();
  int added = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (local.mark(i).look == look) continue;
    const PointSketch& point = points[i];
    Matcher::Query query;
    if (!camera.sees(point, query.at)) continue;
    local.count_visible(i);
    const int octave = predict_octave(point.max_distance_m, query.at.distance_m, pyramid);
    query.radius_px = radius_factor * pyramid.scale[octave] *
                      (query.at.view_cosine > kHeadOnCosine ? kHeadOnRadius_px : kObliqueRadius_px);
    query.min_octave = std::max(0, octave - 1);
    query.max_octave = octave;
    query.descriptor = &point.descriptor;
    const Matcher::Best best =
        matcher_.search(features, query, [&](int feature) { return !frame.points[feature]; });
    if (best.distance > kHammingHigh) continue;
    if (best.octave == best.second_octave &&
        static_cast<float>(best.distance) > kLocalRatio * static_cast<float>(best.second_distance))
      continue;
    frame.match(best.feature, point.id, point.p_w);
    ++added;
  }
  return added;
}

int FrameSearch::optimize_pose(Frame& frame) {
  observations_.clear();
  features_.clear();
  const FeatureSet& features = *frame.features;
  for (int i = 0; i < features.size(); ++i) {
    if (!frame.points[i]) continue;
    const KeyPoint& seen = features.keypoint(i);
    observations_.push_back({frame.p_w[i], seen.u, seen.v, seen.has_depth() ? seen.right_u : -1.0f,
                             features.inv_sigma2(i)});
    features_.push_back(i);
  }
  const PoseResult result =
      optimizer_.solve(features.sensor().camera, frame.T_cw, observations_, outlier_);
  frame.T_cw = result.T_cw;
  for (std::size_t k = 0; k < features_.size(); ++k) frame.outlier[features_[k]] = outlier_[k];
  return result.inliers;
}

}  // namespace slambed
