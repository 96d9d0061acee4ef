// SPDX-License-Identifier: Apache-2.0
#include "slam/point_triangulation.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "features/descriptor_distance.hpp"
#include "geometry/triangulation.hpp"
#include "optimize/pose_optimizer.hpp"
#include "slam/line_kernels.hpp"

namespace slambed {
namespace {

/// Squared distance to the epipolar line in units of the octave's variance: chi-square, one degree
/// of freedom, 5 %.
constexpr float kChi2Line = 3.84f;
constexpr float kNever_px2 = -1;  ///< no squared distance is below it
/// Without depth, a match within ten scaled pixels of the epipole has too little parallax.
constexpr float kEpipole_px2 = 100;
/// Rays of a purely monocular pair must be further apart than this (about 1.15 degrees).
constexpr double kParallelCosine = 0.9998;
/// The views' ratios of distance and octave scale may differ by 1.5 times the scale step of 1.2.
constexpr double kScaleTolerance = 1.5;
constexpr double kChi2StereoNewPoint = 7.8;  ///< ORB-SLAM2 rounds 7.815 here
/// Minimum baseline without depth, as a share of the median depth of the other keyframe's points.
constexpr double kLeastBaselineShare = 0.01;

Eigen::Vector2d normalized(const Camera& camera, const KeyPoint& p) {
  return {(p.u - camera.cx) / camera.fx, (p.v - camera.cy) / camera.fy};
}

/// Cosine of the angle under which the baseline is seen from a point at this depth.
double stereo_cosine(const Camera& camera, const KeyPoint& p) {
  // Equals cos(2 atan(half / depth)).
  const double half = 0.5 * camera.baseline_m(), depth = static_cast<double>(p.depth_m);
  return (depth * depth - half * half) / (depth * depth + half * half);
}

bool reprojects(const KeyFrameCopy& keyframe, int feature, const Eigen::Vector3d& p_w) {
  const Eigen::Vector3d p_c = keyframe.T_cw * p_w;
  if (!(p_c.z() > 0)) return false;
  const Camera& camera = keyframe.features->sensor().camera;
  const KeyPoint& seen = keyframe.features->keypoint(feature);
  const Eigen::Vector2d uv = camera.project(p_c);
  double e2 = (uv - Eigen::Vector2d(seen.u, seen.v)).squaredNorm();
  double limit = kChi2Mono;
  if (seen.right_u >= 0) {
    const double right = uv.x() - camera.bf / p_c.z() - seen.right_u;
    e2 += right * right;
    limit = kChi2StereoNewPoint;
  }
  return e2 * keyframe.features->inv_sigma2(feature) <= limit;
}

/// Triangulates two matching features, or uses measured depth where that is more precise.
std::optional<Eigen::Vector3d> locate(const KeyFrameCopy& a, int feature_a, const KeyFrameCopy& b,
                                      int feature_b) {
  const Camera& camera = a.features->sensor().camera;
  const KeyPoint& seen_a = a.features->keypoint(feature_a);
  const KeyPoint& seen_b = b.features->keypoint(feature_b);
  const Eigen::Vector2d xa = normalized(camera, seen_a), xb = normalized(camera, seen_b);
  const bool stereo_a = seen_a.right_u >= 0, stereo_b = seen_b.right_u >= 0;
  const double rays = cos_parallax(a.T_cw, b.T_cw, xa, xb);
  const double from_a = stereo_a ? stereo_cosine(camera, seen_a) : 2;
  const double from_b = stereo_b ? stereo_cosine(camera, seen_b) : 2;
  const auto unproject = [&](const KeyFrameCopy& k, const KeyPoint& p) {
    return k.T_cw.inverse() * camera.unproject(p.u, p.v, p.depth_m);
  };
  if (rays > 0 && rays < std::min(from_a, from_b) &&
      (stereo_a || stereo_b || rays < kParallelCosine))
    return triangulate(a.T_cw, b.T_cw, xa, xb);
  if (stereo_a && from_a <= from_b) return unproject(a, seen_a);
  if (stereo_b) return unproject(b, seen_b);
  return std::nullopt;
}

/// Returns the minimum useful baseline to a neighbor: the camera's own, or without depth a share of
/// the median depth of the neighbor's points.
double least_baseline(const MapView& view, const KeyFrame& neighbor) {
  const Sensor& sensor = neighbor.features->sensor();
  if (sensor.metric()) return sensor.camera.baseline_m();
  std::vector<double> depths;
  for (const MapPointId id : neighbor.points)
    if (id) depths.push_back((neighbor.T_cw * view.point(id)->p_w).z());
  if (depths.empty()) return 0;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return kLeastBaselineShare * *middle;
}

bool scales_agree(const KeyFrameCopy& a, int feature_a, const KeyFrameCopy& b, int feature_b,
                  const Eigen::Vector3d& p_w) {
  const ScalePyramid& pyramid = a.features->sensor().pyramid;
  const double distance_a = (a.T_cw * p_w).norm(), distance_b = (b.T_cw * p_w).norm();
  if (!(distance_a > 0) || !(distance_b > 0)) return false;
  const double ratio = distance_b / distance_a;
  const double octaves = pyramid.scale[a.features->keypoint(feature_a).octave] /
                         pyramid.scale[b.features->keypoint(feature_b).octave];
  const double tolerance =
      kScaleTolerance * (pyramid.levels() > 1 ? pyramid.scale[1] : pyramid.scale[0]);
  // A point farther away from b has a lower octave there, so both ratios grow together.
  return ratio * tolerance >= octaves && ratio <= octaves * tolerance;
}

}  // namespace

void PointTriangulation::list_loose(const KeyFrameCopy& b) {
  const FeatureSet& features = *b.features;
  loose_.feature.clear();
  loose_.u.clear();
  loose_.v.clear();
  loose_.limit.clear();
  loose_.descriptor.clear();
  for (int j = 0; j < features.size(); ++j) {
    if (b.points[j]) continue;
    const KeyPoint& p = features.keypoint(j);
    loose_.feature.push_back(j);
    loose_.u.push_back(p.u);
    loose_.v.push_back(p.v);
    loose_.limit.push_back(kChi2Line * features.sensor().pyramid.sigma2[p.octave]);
    loose_.descriptor.push_back(features.descriptor(j));
  }
  const std::size_t room = loose_.feature.size() + kLineSlack;
  loose_.u.resize(room);
  loose_.v.resize(room);
  loose_.limit.resize(room, kNever_px2);
  candidates_.resize(room);
  distances_.resize(room);
}

void PointTriangulation::match(const KeyFrameCopy& a, const KeyFrameCopy& b) {
  matches_.clear();
  const FeatureSet& fa = *a.features;
  const FeatureSet& fb = *b.features;
  const Camera& camera = fa.sensor().camera;
  const ScalePyramid& pyramid = fb.sensor().pyramid;
  list_loose(b);
  const LinePoints points{loose_.u.data(), loose_.v.data(), loose_.limit.data(),
                          loose_.feature.size()};
  const LineKernels& lines = fastest_line_kernels();
  const DistanceKernels& distance = descriptor_distance();

  // Epipolar line of x_a in image b: F = K^-T [t]x R K^-1, in pixels.
  const SE3 T_ba = b.T_cw * a.T_cw.inverse();
  Eigen::Matrix3d K_inverse;
  K_inverse << 1 / camera.fx, 0, -camera.cx / camera.fx, 0, 1 / camera.fy, -camera.cy / camera.fy,
      0, 0, 1;
  Eigen::Matrix3d cross;
  cross << 0, -T_ba.t.z(), T_ba.t.y(), T_ba.t.z(), 0, -T_ba.t.x(), -T_ba.t.y(), T_ba.t.x(), 0;
  const Eigen::Matrix3d F = K_inverse.transpose() * cross * T_ba.R * K_inverse;
  const Eigen::Vector2f epipole = camera.project(T_ba.t).cast<float>();
  const bool epipole_ahead = T_ba.t.z() > 0;

  for (int i = 0; i < fa.size(); ++i) {
    if (a.points[i]) continue;
    const KeyPoint& pa = fa.keypoint(i);
    const Eigen::Vector3f line = (F * Eigen::Vector3d(pa.u, pa.v, 1)).cast<float>();
    const float norm2 = line.x() * line.x() + line.y() * line.y();
    if (!(norm2 > 0)) continue;
    const std::size_t found =
        lines.near(points, {line.x(), line.y(), line.z(), norm2}, candidates_.data());
    distance.to_some(fa.descriptor(i), loose_.descriptor.data(), {candidates_.data(), found},
                     distances_.data());
    int best = -1, best_distance = kHammingLow + 1;
    for (std::size_t c = 0; c < found; ++c) {
      if (distances_[c] >= best_distance) continue;
      const int k = candidates_[c];
      const KeyPoint& pb = fb.keypoint(loose_.feature[k]);
      if (pa.right_u < 0 && pb.right_u < 0 && epipole_ahead) {
        const float du = epipole.x() - pb.u, dv = epipole.y() - pb.v;
        if (du * du + dv * dv < kEpipole_px2 * pyramid.scale[pb.octave]) continue;
      }
      best = k;
      best_distance = distances_[c];
    }
    if (best < 0) continue;
    loose_.limit[best] = kNever_px2;  // taken
    matches_.emplace_back(i, loose_.feature[best]);
  }
}

MapDelta PointTriangulation::run(const Map& map, KeyFrameId keyframe, int neighbors,
                                 IdSource<MapPointId>& ids) {
  MapDelta delta;
  std::vector<double> least_baselines;  // of the neighbors
  std::vector<KeyFrameCopy> copies = map.read([&](const MapView& view) {
    std::vector<KeyFrameCopy> list;
    delta.epoch = view.epoch();
    if (const KeyFrame* current = view.keyframe(keyframe)) {
      list.push_back(copy_of(*current));
      for (const KeyFrameId id : best_covisibles(*current, neighbors)) {
        list.push_back(copy_of(*view.keyframe(id)));
        least_baselines.push_back(least_baseline(view, *view.keyframe(id)));
      }
    }
    return list;
  });
  if (copies.size() < 2) return delta;
  KeyFrameCopy& a = copies.front();
  const Eigen::Vector3d center_a = a.T_cw.inverse().t;
  for (std::size_t n = 1; n < copies.size(); ++n) {
    const KeyFrameCopy& b = copies[n];
    if ((b.T_cw.inverse().t - center_a).norm() < least_baselines[n - 1]) continue;
    match(a, b);
    for (const auto& [i, j] : matches_) {
      const auto p_w = locate(a, i, b, j);
      if (!p_w || !reprojects(a, i, *p_w) || !reprojects(b, j, *p_w) ||
          !scales_agree(a, i, b, j, *p_w))
        continue;
      NewPoint point;
      point.id = ids.next();
      point.p_w = *p_w;
      point.reference = point.first_keyframe = a.id;
      a.points[i] = point.id;
      delta.points.push_back(point);
      delta.attach.push_back({a.id, static_cast<std::uint16_t>(i), point.id});
      delta.attach.push_back({b.id, static_cast<std::uint16_t>(j), point.id});
    }
  }
  return delta;
}

}  // namespace slambed
