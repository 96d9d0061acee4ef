// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "synth/drive.hpp"
#include "synth/scene.hpp"

namespace slambed::synth {

/// The street along a drive, by daylight: marked and cracked road, curbs, houses with windows and
/// side streets between them, parked cars, trees, poles, plain sky.
struct StreetOptions {
  std::uint64_t seed = 1;
  int passing_cars = 0;    ///< that come the other way, spread over the route
  int open_stretches = 0;  ///< of 30 m with nothing near the road
  double texel_scale = 1;  ///< larger: coarser textures, quicker to build
  int threads = 1;         ///< only for speed
};

/// A fifth of the parked cars are others in the second lap; each is changed once the first lap has
/// left it behind.
std::shared_ptr<const Scene> make_street(const StreetOptions& options,
                                         std::shared_ptr<const Drive> drive);

}  // namespace slambed::synth
