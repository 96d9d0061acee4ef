// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "map/map.hpp"
#include "slam/tests/synthetic_scene.hpp"
#include "slam/tracker.hpp"

namespace slambed::testing {

inline constexpr double kSame = 1e-9;

inline bool same(const SE3& a, const SE3& b) {
  return (a.R - b.R).norm() < kSame && (a.t - b.t).norm() < kSame;
}

inline std::vector<KeyFrameId> keyframes_in(const Map& map) {
  return map.read([](const MapView& view) { return view.keyframe_ids(); });
}

inline SE3 pose_in(const Map& map, KeyFrameId id) {
  return map.read([&](const MapView& view) { return view.keyframe(id)->T_cw; });
}

/// Counts the features of a keyframe that have a map point.
inline std::ptrdiff_t points_of(const Map& map, KeyFrameId id) {
  return map.read([&](const MapView& view) {
    const auto& points = view.keyframe(id)->points;
    return std::count_if(points.begin(), points.end(),
                         [&](MapPointId point) { return point && view.point(point); });
  });
}

inline void expect_every_point_there(const Map& map) {
  map.read([&](const MapView& view) {
    for (const KeyFrameId id : view.keyframe_ids()) {
      for (const MapPointId point : view.keyframe(id)->points) {
        if (point) {
          EXPECT_NE(view.point(point), nullptr) << "of keyframe " << id.value;
        }
      }
    }
    return 0;
  });
}

inline constexpr int kPerUpdate = 6;  ///< keyframes
inline constexpr int kFeatures = 100, kThings = 4000;
inline constexpr double kTurn_deg = 3;  ///< per frame

inline TrackerOptions few_features() {
  TrackerOptions options;
  options.min_init_features = 50;
  options.min_local_map_inliers = 15;
  options.min_inliers_after_relocalization = 20;
  options.reset_below_keyframes = 0;
  options.second_hypotheses = false;
  options.follow_recovery = true;
  return options;
}

inline SE3 turned(double deg) {
  const double yaw = deg * M_PI / 180;
  const Eigen::Vector3d center(0.5 * std::sin(yaw), 0.1 * std::sin(3 * yaw), -0.5 * std::cos(yaw));
  return SE3(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix(), center).inverse();
}

/// Totals over all orders of events.
struct Seen {
  int swaps = 0, kept_recoveries = 0, last_frames = 0;
  int answers = 0, of_a_moved_world = 0, during_an_update = 0, resumed = 0, declined = 0, local = 0;
  std::size_t carried = 0;
};

}  // namespace slambed::testing
