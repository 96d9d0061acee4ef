// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <numbers>

#include "node/tests/virtual_pair.hpp"
#include "offload/tests/offload_params.hpp"

namespace slambed::testing {

/// frame: may be fractional.
inline SE3 pose_at(double frame) {
  const double yaw = 2.5 * frame * std::numbers::pi / 180;
  const Eigen::Vector3d center(0.5 * std::sin(yaw), 0.1 * std::sin(3 * yaw), -0.5 * std::cos(yaw));
  const Eigen::Matrix3d R_wc = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return SE3(R_wc, center).inverse();
}

/// The camera turns in a room at 25 degrees per second and 10 frames per second, so that new
/// keyframes are always needed.
inline std::shared_ptr<const FeatureSet> turn(SyntheticScene& scene, int frame) {
  return scene.look(pose_at(frame));
}

/// A lens with a wrong focal length: after a full turn, 3.6 degrees are missing.
inline std::shared_ptr<const FeatureSet> through_a_wrong_lens(SyntheticScene& scene, int frame) {
  constexpr float kZoom = 0.99f;
  const auto seen = turn(scene, frame);
  const auto& camera = scene.sensor()->camera;
  std::vector<KeyPoint> keypoints(seen->keypoints().begin(), seen->keypoints().end());
  for (KeyPoint& p : keypoints) {
    const float disparity = p.u - p.right_u;
    p.u = static_cast<float>(camera.cx) + kZoom * (p.u - static_cast<float>(camera.cx));
    p.v = static_cast<float>(camera.cy) + kZoom * (p.v - static_cast<float>(camera.cy));
    p.right_u = p.u - disparity;
  }
  return std::make_shared<FeatureSet>(
      scene.sensor(), std::move(keypoints),
      std::vector<Descriptor>(seen->descriptors().begin(), seen->descriptors().end()));
}

}  // namespace slambed::testing
