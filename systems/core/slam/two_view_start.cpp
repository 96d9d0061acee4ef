// SPDX-License-Identifier: Apache-2.0
#include "slam/two_view_start.hpp"

#include <algorithm>

#include "geometry/two_view.hpp"
#include "optimize/bundle_adjuster.hpp"

namespace slambed {
namespace {

// ORB-SLAM2's limits. ORB-SLAM2 extracts twice the features until it has a map and matches those of
// the finest level. Here the usual features are matched level by level, but all with the finest
// level's tolerance: a wider one makes every scene look planar.
constexpr float kWindow_px = 100;
constexpr float kStartRatio = 0.9f;
constexpr std::size_t kStartMatches = 100;
constexpr std::size_t kLeastPoints = 100;
constexpr BundleOptions kBundle{
    .robust_iterations = 20, .final_iterations = 10, .relative_stop = 1e-6};

/// Refines motion and points together; keeps the pairs that fit in both images.
void refine(const FeatureSet& first, const FeatureSet& second, SE3& T_21,
            std::vector<std::pair<int, int>>& pairs, std::vector<Eigen::Vector3d>& p_w) {
  BundleProblem problem;
  problem.camera = first.sensor().camera;
  problem.T_cw = {T_21, SE3()};
  problem.free_poses = 1;
  problem.p_w = p_w;
  for (std::uint32_t k = 0; k < pairs.size(); ++k) {
    const KeyPoint &a = first.keypoint(pairs[k].first), &b = second.keypoint(pairs[k].second);
    problem.observations.push_back({1, k, a.u, a.v, -1, first.inv_sigma2(pairs[k].first)});
    problem.observations.push_back({0, k, b.u, b.v, -1, second.inv_sigma2(pairs[k].second)});
  }
  BundleAdjuster adjuster(std::move(problem), kBundle);
  while (adjuster.step()) {
  }
  const std::vector<std::uint8_t> outlier = adjuster.outliers();
  T_21 = adjuster.problem().T_cw[0];
  std::size_t kept = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (outlier[2 * k] || outlier[2 * k + 1]) continue;
    pairs[kept] = pairs[k];
    p_w[kept++] = adjuster.problem().p_w[k];
  }
  pairs.resize(kept);
  p_w.resize(kept);
}

double median_depth(std::vector<Eigen::Vector3d> points) {
  const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(points.begin(), middle, points.end(),
                   [](const auto& a, const auto& b) { return a.z() < b.z(); });
  return middle->z();
}

}  // namespace

void TwoViewStart::wait_with(const Frame& frame) {
  features_ = frame.features;
  index_ = frame.index;
  timestamp_s_ = frame.timestamp_s;
  expected_.clear();
  for (const KeyPoint& p : features_->keypoints()) expected_.emplace_back(p.u, p.v);
}

void TwoViewStart::match(const FeatureSet& second) {
  struct Holder {
    int first = -1, distance = 257;
  };
  std::vector<Holder> holders(second.size());
  for (int i = 0; i < features_->size(); ++i) {
    const int octave = features_->keypoint(i).octave;
    Matcher::Query query;
    query.at.u = expected_[i].x();
    query.at.v = expected_[i].y();
    query.radius_px = kWindow_px;
    query.min_octave = query.max_octave = octave;
    query.descriptor = &features_->descriptor(i);
    const Matcher::Best best = matcher_.search(second, query, [](int) { return true; });
    if (best.feature < 0 || best.distance > kHammingLow ||
        static_cast<float>(best.distance) >= kStartRatio * static_cast<float>(best.second_distance))
      continue;
    Holder& holder = holders[best.feature];
    if (best.distance < holder.distance) holder = {i, best.distance};
  }
  rotation_.clear();
  for (int j = 0; j < second.size(); ++j)
    if (holders[j].first >= 0)
      rotation_.add(features_->keypoint(holders[j].first).angle_deg, second.keypoint(j).angle_deg,
                    j);
  for (const int j : rotation_.disagreeing()) holders[j].first = -1;
  pairs_.clear();
  for (int j = 0; j < second.size(); ++j) {
    if (holders[j].first < 0) continue;
    pairs_.emplace_back(holders[j].first, j);
    expected_[holders[j].first] = {second.keypoint(j).u, second.keypoint(j).v};
  }
}

std::optional<MapDelta> TwoViewStart::offer(Frame& frame, TrackerIds& ids) {
  if (!features_) {
    wait_with(frame);
    return std::nullopt;
  }
  const FeatureSet& second = *frame.features;
  match(second);
  if (pairs_.size() < kStartMatches) {
    wait_with(frame);
    return std::nullopt;
  }
  std::vector<PixelPair> pixels;
  pixels.reserve(pairs_.size());
  for (const auto& [i, j] : pairs_) {
    const KeyPoint &a = features_->keypoint(i), &b = second.keypoint(j);
    pixels.push_back({{a.u, a.v}, {b.u, b.v}});
  }
  const TwoViewResult found = reconstruct_two_views(second.sensor().camera, pixels);
  if (!found) return std::nullopt;
  Pairs pairs;
  std::vector<Eigen::Vector3d> p_w;
  for (std::size_t k = 0; k < pairs_.size(); ++k) {
    if (!found.good[k]) continue;
    pairs.push_back(pairs_[k]);
    p_w.push_back(found.p_1[k]);
  }
  SE3 T_21 = found.T_21;
  refine(*features_, second, T_21, pairs, p_w);
  if (pairs.size() < kLeastPoints) return std::nullopt;
  const double unit = median_depth(p_w);
  for (Eigen::Vector3d& p : p_w) p /= unit;
  frame.T_cw = SE3(T_21.R, T_21.t / unit);
  MapDelta delta = make_map(pairs, p_w, frame, ids);
  reset();
  return delta;
}

MapDelta TwoViewStart::make_map(const Pairs& pairs, const std::vector<Eigen::Vector3d>& p_w,
                                Frame& frame, TrackerIds& ids) const {
  MapDelta delta;
  NewKeyFrame first, second;
  first.id = ids.keyframes.next();
  second.id = ids.keyframes.next();
  first.frame_index = index_;
  first.timestamp_s = timestamp_s_;
  first.features = features_;
  first.points.resize(features_->size());
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    NewPoint point;
    point.id = ids.points.next();
    point.p_w = p_w[k];
    point.reference = point.first_keyframe = second.id;
    first.points[pairs[k].first] = point.id;
    frame.match(pairs[k].second, point.id, point.p_w);
    delta.points.push_back(point);
  }
  second.frame_index = frame.index;
  second.timestamp_s = frame.timestamp_s;
  second.features = frame.features;
  second.T_cw = frame.T_cw;
  second.points = frame.points;
  delta.keyframes.push_back(std::move(first));
  delta.keyframes.push_back(std::move(second));
  return delta;
}

}  // namespace slambed
