// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "synth/drive.hpp"
#include "synth/scene.hpp"

namespace slambed::synth {

/// The street along a drive by daylight: marked and cracked road, curbs, houses with windows, side
/// streets, parked cars, trees, poles, and a plain sky.
struct StreetOptions {
  std::uint64_t seed = 1;
  int passing_cars = 0;    ///< oncoming cars, spread over the route
  int open_stretches = 0;  ///< stretches of 30 m with nothing near the road
  double texel_scale = 1;  ///< larger: coarser textures, faster to build
  int threads = 1;         ///< does not change the result
};

/// Builds the street. A fifth of the parked cars change between the laps: each is replaced or
/// removed after the car has passed it in lap 1.
std::shared_ptr<const Scene> make_street(const StreetOptions& options,
                                         std::shared_ptr<const Drive> drive);

}  // namespace slambed::synth
