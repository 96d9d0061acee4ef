// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "features/vocabulary.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {

/// A vocabulary of the scene's own descriptors. In a vocabulary of real images a few flipped bits
/// of a random descriptor would change its word.
inline std::shared_ptr<const Vocabulary> scene_vocabulary(SyntheticScene& scene) {
  std::vector<std::vector<Descriptor>> images;
  for (int turn = 0; turn < 24; ++turn) {
    const SE3 T_cw(Eigen::AngleAxisd(turn * M_PI / 12, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                   Eigen::Vector3d::Zero());
    const auto features = scene.look(T_cw, {.flipped_bits = 10});
    images.emplace_back(features->descriptors().begin(), features->descriptors().end());
  }
  return std::make_shared<const Vocabulary>(
      Vocabulary::train(images, {.branching = 10, .depth = 3, .rounds = 6}));
}

}  // namespace slambed::testing
