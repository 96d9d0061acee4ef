// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "features/feature_set.hpp"
#include "features/vocabulary.hpp"
#include "geometry/se3.hpp"
#include "geometry/tests/draws.hpp"

namespace slambed::testing {

/// An endless hall: every 2 m cell holds the same few dozen points each time it is seen. They are
/// generated from the cell's number and never stored, so a map can grow without limit and the
/// measured memory is the map's alone.
class EndlessScene {
 public:
  EndlessScene() {
    auto sensor = std::make_shared<Sensor>();
    sensor->camera = {
        .width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240, .bf = 40};
    sensor->bounds = {0, 0, 640, 480};
    sensor->close_depth_m = 3.2f;
    sensor_ = std::move(sensor);
    for (Descriptor& look : looks_)
      for (auto& word : look) word = random_();
  }

  std::shared_ptr<const FeatureSet> look(const SE3& T_cw) {
    const Eigen::Vector3d eye = T_cw.inverse().t;
    const Eigen::Vector3d ahead = T_cw.R.row(2);
    std::vector<KeyPoint> keypoints;
    std::vector<Descriptor> descriptors;
    const int reach = static_cast<int>(kReach_m / kCell_m);
    const int cx = static_cast<int>(std::floor(eye.x() / kCell_m));
    const int cz = static_cast<int>(std::floor(eye.z() / kCell_m));
    for (int ix = cx - reach; ix <= cx + reach; ++ix) {
      for (int iz = cz - reach; iz <= cz + reach; ++iz) {
        const Eigen::Vector3d middle((ix + 0.5) * kCell_m, eye.y(), (iz + 0.5) * kCell_m);
        if ((middle - eye).dot(ahead) < -kCell_m) continue;
        see_cell(ix, iz, T_cw, keypoints, descriptors);
      }
    }
    return std::make_shared<FeatureSet>(sensor_, std::move(keypoints), std::move(descriptors));
  }

  /// Trained on the points' descriptors.
  std::shared_ptr<const Vocabulary> vocabulary() {
    std::vector<std::vector<Descriptor>> images(kLooks / 500);
    for (std::size_t i = 0; i < kLooks; ++i)
      for (int copy = 0; copy < 3; ++copy)
        images[i / 500].push_back(flipped(looks_[i], kOwnBits, random_));
    return std::make_shared<const Vocabulary>(
        Vocabulary::train(images, {.branching = 10, .depth = 4, .rounds = 5}));
  }

 private:
  static constexpr double kCell_m = 2, kReach_m = 13;
  static constexpr int kPerCell = 30, kOwnBits = 20, kNoisyBits = 8;
  static constexpr std::size_t kLooks = 20'000;
  static constexpr double kPixelNoise = 0.5, kDepthNoise = 0.01;

  template <typename Random>
  static Descriptor flipped(Descriptor descriptor, int bits, Random& random) {
    for (int b = 0; b < bits; ++b) {
      const auto bit = random() % 256;
      descriptor[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    return descriptor;
  }

  void see_cell(int ix, int iz, const SE3& T_cw, std::vector<KeyPoint>& keypoints,
                std::vector<Descriptor>& descriptors) {
    std::minstd_rand place(static_cast<std::uint32_t>(ix) * 73856093u ^
                           static_cast<std::uint32_t>(iz) * 19349663u ^ 0x5bd1e995u);
    place.discard(3);
    const auto unit = [&] { return (place() % 100'000) / 100'000.0; };
    std::normal_distribution<double> noise;
    for (int i = 0; i < kPerCell; ++i) {
      const Eigen::Vector3d inside = drawn<3>(unit);
      const Eigen::Vector3d p_w((ix + inside.x()) * kCell_m, 3 * inside.y() - 1.5,
                                (iz + inside.z()) * kCell_m);
      const double max_distance_m = 4 + 9 * unit();
      const double angle_deg = 359 * unit();
      const std::size_t like = place() % kLooks;
      const auto own = static_cast<std::uint32_t>(place());
      const Eigen::Vector3d p = T_cw * p_w;
      if (p.z() < 0.4) continue;
      const auto octave =
          static_cast<int>(std::lround(std::log(max_distance_m / p.norm()) / std::log(1.2)));
      if (octave < 0 || octave > 7) continue;
      const double scale = sensor_->pyramid.scale[octave];
      Eigen::Vector2d uv = sensor_->camera.project(p);
      uv += kPixelNoise * scale * drawn<2>([&] { return noise(random_); });
      if (!sensor_->bounds.contains(uv.x(), uv.y())) continue;
      KeyPoint seen;
      seen.u = static_cast<float>(uv.x());
      seen.v = static_cast<float>(uv.y());
      seen.octave = static_cast<std::uint8_t>(octave);
      seen.angle_deg = static_cast<float>(angle_deg);
      const double depth_m = p.z() * (1 + kDepthNoise * noise(random_));
      seen.depth_m = static_cast<float>(depth_m);
      seen.right_u = static_cast<float>(uv.x() - sensor_->camera.bf / depth_m);
      std::minstd_rand own_bits(own | 1);
      keypoints.push_back(seen);
      descriptors.push_back(
          flipped(flipped(looks_[like], kOwnBits, own_bits), kNoisyBits, random_));
    }
  }

  std::mt19937_64 random_{1};
  std::shared_ptr<const Sensor> sensor_;
  std::vector<Descriptor> looks_ = std::vector<Descriptor>(kLooks);
};

}  // namespace slambed::testing
