// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "synth/actor.hpp"

namespace slambed::synth {

/// Adds a person to a scene: every part is a moving body made of rings of faces. Clothes depend on
/// the seed (plain, patterned or striped; sleeves and trousers long or short). A sitting person
/// gets a stool. number: the figure's id in labels, from 1. texel_scale: coarser textures.
void add_figure(Scene& scene, std::shared_ptr<const Actor> actor, int number, std::uint64_t seed,
                double texel_scale);

}  // namespace slambed::synth
