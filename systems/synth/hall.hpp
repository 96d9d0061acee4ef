// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "synth/scene.hpp"

namespace slambed::synth {

/// A hall of 16 x 12 x 5 m around the world's origin. Crates and shelves stand on islands. The
/// floor and the walls between them are so bare that they give hardly any features.
struct HallOptions {
  std::uint64_t seed = 1;
  double clearance_m = 0.45;  ///< objects nearer to the camera path are left out
  double texel_scale = 1;     ///< larger: coarser textures, faster to build
  int threads = 1;            ///< does not change the result
};

std::shared_ptr<const Scene> make_hall(const HallOptions& options,
                                       std::span<const Vec3> kept_clear);

}  // namespace slambed::synth
