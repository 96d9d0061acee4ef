// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "map/map.hpp"

namespace slambed::testing {

inline constexpr std::uint64_t kMobile = std::uint64_t{1} << 56;
inline constexpr std::uint64_t kEdge = std::uint64_t{2} << 56;
inline KeyFrameId kf(std::uint64_t n) { return {kMobile | n}; }
inline MapPointId pt(std::uint64_t n) { return {kMobile | n}; }

inline std::shared_ptr<const Sensor> make_sensor() {
  auto sensor = std::make_shared<Sensor>();
  sensor->camera.width = 640;
  sensor->camera.height = 480;
  sensor->camera.fx = sensor->camera.fy = 500;
  sensor->camera.cx = 320;
  sensor->camera.cy = 240;
  sensor->camera.bf = 40;
  sensor->bounds = {0, 0, 640, 480};
  sensor->close_depth_m = 3.2f;
  return sensor;
}

/// Returns n features with random descriptors; those with an even index have depth.
inline std::shared_ptr<const FeatureSet> make_features(int n, unsigned seed = 1) {
  static const auto sensor = make_sensor();
  std::mt19937_64 random(seed);
  std::vector<KeyPoint> keypoints(n);
  std::vector<Descriptor> descriptors(n);
  for (int i = 0; i < n; ++i) {
    keypoints[i].u = static_cast<float>(10 + random() % 600);
    keypoints[i].v = static_cast<float>(10 + random() % 400);
    keypoints[i].octave = static_cast<std::uint8_t>(random() % 8);
    if (i % 2 == 0) {
      keypoints[i].depth_m = 2;
      keypoints[i].right_u = keypoints[i].u - 20;
    }
    for (auto& word : descriptors[i]) word = random();
  }
  return std::make_shared<FeatureSet>(sensor, std::move(keypoints), std::move(descriptors));
}

inline NewPoint new_point(std::uint64_t n, Eigen::Vector3d p_w = {0, 0, 2}) {
  NewPoint point;
  point.id = pt(n);
  point.p_w = p_w;
  point.reference = point.first_keyframe = kf(1);
  return point;
}

/// Returns keyframe n, whose feature i sees points[i] (0: none).
inline NewKeyFrame new_keyframe(std::uint64_t n, const std::vector<std::uint64_t>& points) {
  NewKeyFrame keyframe;
  keyframe.id = kf(n);
  keyframe.frame_index = n;
  keyframe.timestamp_s = 0.1 * static_cast<double>(n);
  keyframe.features =
      make_features(std::max(40, static_cast<int>(points.size())), static_cast<unsigned>(n));
  keyframe.T_cw.t = {0.1 * static_cast<double>(n), 0, 0};
  keyframe.points.resize(keyframe.features->size());
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i]) keyframe.points[i] = pt(points[i]);
  return keyframe;
}

/// Returns the numbers first, first + 1, ... as a keyframe's point list.
inline std::vector<std::uint64_t> points_from(std::uint64_t first, int count) {
  std::vector<std::uint64_t> numbers(count);
  for (int i = 0; i < count; ++i) numbers[i] = first + i;
  return numbers;
}

/// Returns everything a reader can see as text; equal texts mean equal maps.
inline std::string dump(const Map& map) {
  return map.read([](const MapView& view) {
    std::ostringstream out;
    out.precision(17);
    out << view.keyframe_count() << ' ' << view.point_count() << ' ' << view.origin().value << '\n';
    for (const KeyFrameId id : view.keyframe_ids()) {
      const KeyFrame& k = *view.keyframe(id);
      out << "k " << id.value << " v" << k.version << ' ' << k.T_cw.t.transpose() << " p"
          << k.parent.value << " c";
      for (const KeyFrameId child : k.children) out << ' ' << child.value;
      out << " s";
      for (const Covisible& c : k.covisibles) out << ' ' << c.id.value << ':' << c.weight;
      for (std::size_t i = 0; i < k.points.size(); ++i)
        if (k.points[i]) out << ' ' << i << '=' << k.points[i].value;
      out << '\n';
    }
    for (const MapPointId id : view.point_ids()) {
      const MapPoint& p = *view.point(id);
      out << "p " << id.value << " v" << p.version << ' ' << p.p_w.transpose() << " w" << p.weight
          << " r" << p.reference.value << ' ' << p.visible << '/' << p.found << ' '
          << p.appearance.descriptor[0] << ' ' << p.appearance.normal.transpose() << ' '
          << p.appearance.min_distance_m << ' ' << p.appearance.max_distance_m;
      for (const Observation& o : p.observations)
        out << ' ' << o.keyframe.value << '@' << o.feature;
      out << '\n';
    }
    return out.str();
  });
}

}  // namespace slambed::testing
