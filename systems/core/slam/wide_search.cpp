// SPDX-License-Identifier: Apache-2.0
#include "slam/wide_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/portable_math.hpp"
#include "features/descriptor_distance.hpp"
#include "geometry/p3p.hpp"
#include "geometry/random_sample.hpp"

namespace slambed {
namespace {

/// Maximum distance of a match in bits, and its maximum ratio to distances elsewhere in the image.
constexpr int kMaxDistance = 64;
constexpr float kWideRatio = 0.85f;
/// Features this near (px at octave 0) are one corner on several octaves and do not compete.
constexpr float kSamePlace_px = 8;
constexpr int kWideMatches = 12;
constexpr int kLeastInliers = 10;

// RANSAC limits: poses tried and samples drawn for them. The depths alone rule out most samples.
constexpr int kMaxPoses = 400;
constexpr int kMaxSamples = 8000;
constexpr double kConfidence = 0.995;
/// Maximum error of a distance between two points, as a share of their measured depths.
constexpr double kDepthError = 0.04;

double chi2(const Camera& camera, const SE3& T_cw, const Eigen::Vector3d& p_w, const KeyPoint& seen,
            float inv_sigma2) {
  const Eigen::Vector3d p_c = T_cw * p_w;
  if (!(p_c.z() > 0)) return INFINITY;
  const Eigen::Vector2d pixel = camera.project(p_c);
  const double du = pixel.x() - seen.u, dv = pixel.y() - seen.v;
  return (du * du + dv * dv) * inv_sigma2;
}

}  // namespace

void WideSearch::match(std::span<const PointSketch> points, const FeatureSet& features) {
  struct Holder {
    int point = -1, distance = 257;
  };
  const int n = features.size();
  const Sensor& sensor = features.sensor();
  std::vector<Holder> holder(n);
  distances_.resize(n);
  for (std::size_t p = 0; p < points.size(); ++p) {
    descriptor_distance().to_all(points[p].descriptor, features.descriptors(), distances_.data());
    const auto closest = std::min_element(distances_.begin(), distances_.end());
    const int best = static_cast<int>(closest - distances_.begin());
    // If two points match one feature, the closer one keeps it.
    if (n == 0 || *closest > kMaxDistance || *closest >= holder[best].distance) continue;
    const KeyPoint& seen = features.keypoint(best);
    const float near_px = kSamePlace_px * sensor.pyramid.scale[seen.octave];
    bool unique = true;
    for (int i = 0; i < n && unique; ++i) {
      if (kWideRatio * static_cast<float>(distances_[i]) > static_cast<float>(*closest)) continue;
      const KeyPoint& other = features.keypoint(i);
      unique = std::abs(other.u - seen.u) <= near_px && std::abs(other.v - seen.v) <= near_px;
    }
    if (unique) holder[best] = {static_cast<int>(p), *closest};
  }
  pairs_.clear();
  for (int i = 0; i < n; ++i) {
    if (holder[i].point < 0) continue;
    const KeyPoint& seen = features.keypoint(i);
    // Far depths are unreliable.
    const bool deep = seen.has_depth() && seen.depth_m < sensor.close_depth_m;
    pairs_.push_back(
        {holder[i].point, i,
         deep ? sensor.camera.unproject(seen.u, seen.v, seen.depth_m) : Eigen::Vector3d(0, 0, -1)});
  }
}

/// Estimates the pose with the most inlier pairs.
bool WideSearch::agree(const std::vector<Pair>& pairs, std::span<const PointSketch> points,
                       const FeatureSet& features, SE3& T_cw) {
  const Camera& camera = features.sensor().camera;
  const auto disagree = [&](const Pair& a, const Pair& b) {
    if (a.p_c.z() < 0 || b.p_c.z() < 0) return false;
    const double there = (points[a.point].p_w - points[b.point].p_w).norm();
    return std::abs((a.p_c - b.p_c).norm() - there) > kDepthError * (a.p_c.z() + b.p_c.z());
  };
  inlier_.resize(pairs.size());
  int most = 0;
  SplitMix64 random(1);
  int samples = kMaxSamples, poses_tried = 0;
  for (int drawn = 0; drawn < samples && poses_tried < kMaxPoses; ++drawn) {
    const auto sample = draw_sample<4>(random, pairs.size());
    bool plausible = true;
    for (int i = 0; i < 4 && plausible; ++i)
      for (int j = i + 1; j < 4 && plausible; ++j)
        plausible = !disagree(pairs[sample[i]], pairs[sample[j]]);
    if (!plausible) continue;
    ++poses_tried;
    std::array<Eigen::Vector3d, 3> p_w, rays;
    for (int i = 0; i < 3; ++i) {
      const Pair& pair = pairs[sample[i]];
      const KeyPoint& seen = features.keypoint(pair.feature);
      p_w[i] = points[pair.point].p_w;
      rays[i] = camera.unproject(seen.u, seen.v, 1).normalized();
    }
    const Pair& judge = pairs[sample[3]];
    const auto error = [&](const SE3& pose) {
      return chi2(camera, pose, points[judge.point].p_w, features.keypoint(judge.feature),
                  features.inv_sigma2(judge.feature));
    };
    const auto poses = solve_p3p(p_w, rays);
    const auto chosen =
        std::min_element(poses.begin(), poses.end(),
                         [&](const SE3& a, const SE3& b) { return error(a) < error(b); });
    if (chosen == poses.end()) continue;
    int count = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const Pair& pair = pairs[i];
      inlier_[i] = chi2(camera, *chosen, points[pair.point].p_w, features.keypoint(pair.feature),
                        features.inv_sigma2(pair.feature)) <= kChi2Mono;
      count += inlier_[i];
    }
    if (count <= most) continue;
    most = count;
    best_inlier_ = inlier_;
    T_cw = *chosen;
    const double share = static_cast<double>(count) / static_cast<double>(pairs.size());
    const double all_good = share * share * share * share;
    if (all_good >= 1) break;
    const double needed = portable::log(1 - kConfidence) / portable::log1p(-all_good);
    samples = static_cast<int>(std::min<double>(samples, std::ceil(needed)));
  }
  return most >= kLeastInliers;
}

bool WideSearch::locate(std::span<const PointSketch> points, FrameSearch& search, Frame& frame) {
  frame.clear_matches();
  match(points, *frame.features);
  if (pairs_.size() < kWideMatches) return false;
  if (!agree(pairs_, points, *frame.features, frame.T_cw)) return false;
  for (std::size_t i = 0; i < pairs_.size(); ++i)
    if (best_inlier_[i])
      frame.match(pairs_[i].feature, points[pairs_[i].point].id, points[pairs_[i].point].p_w);
  const int inliers = search.optimize_pose(frame);
  frame.drop_outliers();
  return inliers >= kLeastInliers;
}

}  // namespace slambed
