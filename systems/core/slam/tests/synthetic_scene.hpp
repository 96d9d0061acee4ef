// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "features/feature_set.hpp"
#include "geometry/se3.hpp"
#include "geometry/tests/draws.hpp"
#include "map/map.hpp"

namespace slambed::testing {

/// Quality of the camera.
struct Seeing {
  double pixel_noise = 0;      ///< times the octave's scale, px
  double depth_noise = 0;      ///< as a share of the depth
  int flipped_bits = 0;        ///< of each descriptor
  double depth_limit_m = 1e9;  ///< no depth beyond this
  double wrong_share = 0;      ///< share of features moved elsewhere
};

/// A room of points with unique descriptors, seen by a perfect or noisy RGB-D camera or by a
/// monocular one.
class SyntheticScene {
 public:
  explicit SyntheticScene(int points = 5000, unsigned seed = 1, bool mono = false) : random_(seed) {
    auto sensor = std::make_shared<Sensor>();
    Camera& camera = sensor->camera;
    camera.width = 640;
    camera.height = 480;
    camera.fx = camera.fy = 500;
    camera.cx = 320;
    camera.cy = 240;
    camera.bf = mono ? 0 : 40;
    sensor->bounds = {0, 0, 640, 480};
    sensor->close_depth_m = mono ? 0 : 3.2f;
    sensor_ = std::move(sensor);
    // The walls of a box 8 m wide and deep and 4 m high, and things inside it.
    std::uniform_real_distribution<double> unit(-1, 1);
    for (int i = 0; i < points; ++i) {
      Eigen::Vector3d p =
          Eigen::Vector3d(4, 2, 4).cwiseProduct(drawn<3>([&] { return unit(random_); }));
      const int wall = static_cast<int>(random_() % 8);
      if (wall == 0) p.x() = 4;
      if (wall == 1) p.x() = -4;
      if (wall == 2) p.z() = -4;
      if (wall == 3) p.y() = 2;
      if (wall == 4) p.z() = 4;
      Thing thing;
      thing.p_w = p;
      for (auto& word : thing.descriptor) word = random_();
      thing.max_distance_m = 4 + 9 * std::abs(unit(random_));
      thing.angle_deg = 180 + 179 * unit(random_);
      things_.push_back(thing);
    }
  }

  std::shared_ptr<const Sensor> sensor() const { return sensor_; }
  const Eigen::Vector3d& point(int thing) const { return things_[thing].p_w; }

  /// What the camera at T_cw sees; at most `limit` features, spread over all.
  std::shared_ptr<const FeatureSet> look(const SE3& T_cw, const Seeing& view = {},
                                         int limit = 1000) {
    std::vector<KeyPoint> keypoints;
    std::vector<Descriptor> descriptors;
    seen_.clear();
    std::normal_distribution<double> noise;
    const Camera& camera = sensor_->camera;
    for (std::size_t i = 0; i < things_.size(); ++i) {
      const Thing& thing = things_[i];
      const Eigen::Vector3d p = T_cw * thing.p_w;
      if (p.z() < 0.3 || static_cast<int>(keypoints.size()) >= limit) continue;
      Eigen::Vector2d uv = camera.project(p);
      if (!sensor_->bounds.contains(uv.x(), uv.y())) continue;
      const auto octave = static_cast<int>(
          std::lround(std::log(thing.max_distance_m / p.norm()) / std::log(1.2) - 1e-9));
      if (octave < 0 || octave > 7) continue;
      const double scale = sensor_->pyramid.scale[octave];
      uv += view.pixel_noise * scale * drawn<2>([&] { return noise(random_); });
      if (view.wrong_share > 0 && random_() % 1000 < view.wrong_share * 1000)
        uv += Eigen::Vector2d(30, -25);
      if (!sensor_->bounds.contains(uv.x(), uv.y())) continue;
      KeyPoint seen;
      seen.u = static_cast<float>(uv.x());
      seen.v = static_cast<float>(uv.y());
      seen.octave = static_cast<std::uint8_t>(octave);
      seen.angle_deg = static_cast<float>(thing.angle_deg);
      if (sensor_->metric() && p.z() < view.depth_limit_m) {
        const double depth_m = p.z() * (1 + view.depth_noise * noise(random_));
        seen.depth_m = static_cast<float>(depth_m);
        seen.right_u = static_cast<float>(uv.x() - camera.bf / depth_m);
      }
      Descriptor descriptor = thing.descriptor;
      for (int b = 0; b < view.flipped_bits; ++b) {
        const auto flip = random_() % 256;
        descriptor[flip / 64] ^= std::uint64_t{1} << (flip % 64);
      }
      keypoints.push_back(seen);
      descriptors.push_back(descriptor);
      seen_.push_back(static_cast<int>(i));
    }
    return std::make_shared<FeatureSet>(sensor_, std::move(keypoints), std::move(descriptors));
  }

  std::shared_ptr<const FeatureSet> nothing() const {
    return std::make_shared<FeatureSet>(sensor_, std::vector<KeyPoint>{},
                                        std::vector<Descriptor>{});
  }

  /// The point that each feature of the last look() shows.
  const std::vector<int>& seen() const { return seen_; }

 private:
  struct Thing {
    Eigen::Vector3d p_w;
    Descriptor descriptor{};
    double max_distance_m = 0, angle_deg = 0;
  };
  std::mt19937_64 random_;
  std::shared_ptr<const Sensor> sensor_;
  std::vector<Thing> things_;
  std::vector<int> seen_;
};

/// Hand-held walk at 30 Hz: a gentle sway and turn in the middle of the room.
inline SE3 walk(int frame) {
  const double s = frame / 30.0;
  const Eigen::Vector3d center(0.6 * std::sin(0.8 * s), 0.1 * std::sin(1.9 * s),
                               -1.0 + 0.5 * std::sin(0.5 * s));
  const Eigen::Matrix3d R_wc =
      (Eigen::AngleAxisd(0.6 * std::sin(0.7 * s), Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.1 * std::sin(1.1 * s), Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return SE3(R_wc, center).inverse();
}

/// A walk with more translation than rotation, as a monocular camera needs for depth.
inline SE3 stroll(int frame) {
  const double s = frame / 30.0;
  const Eigen::Vector3d center(1.2 * std::sin(0.9 * s), 0.2 * std::sin(1.3 * s),
                               -1.0 + 0.3 * std::sin(0.5 * s));
  const Eigen::Matrix3d R_wc =
      Eigen::AngleAxisd(0.1 * std::sin(0.7 * s), Eigen::Vector3d::UnitY()).toRotationMatrix();
  return SE3(R_wc, center).inverse();
}

/// The same with a slow turn: after ten seconds nothing of the start is in view.
inline SE3 stroll_round(int frame) {
  const Eigen::AngleAxisd turn(0.1 * frame / 30.0, Eigen::Vector3d::UnitY());
  return SE3(turn.toRotationMatrix(), Eigen::Vector3d::Zero()) * stroll(frame);
}

/// Distance between camera centers, m.
inline double center_error(const SE3& a, const SE3& b) {
  return (a.inverse().t - b.inverse().t).norm();
}
inline double turn_error_deg(const SE3& a, const SE3& b) {
  return Eigen::AngleAxisd(a.R * b.R.transpose()).angle() * 180 / M_PI;
}

}  // namespace slambed::testing
