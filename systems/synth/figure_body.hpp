// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "synth/actor.hpp"

namespace slambed::synth {

/// Puts a person into a scene: a moving body for every part, rounded by rings of faces, in clothes
/// that hang on the seed (plain, patterned or striped; sleeves and trousers long or short). Whoever
/// sits gets a stool. `number`: what labels call the figure, from 1. Textures are built
/// `texel_scale` times coarser.
void add_figure(Scene& scene, std::shared_ptr<const Actor> actor, int number, std::uint64_t seed,
                double texel_scale);

}  // namespace slambed::synth
