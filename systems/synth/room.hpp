// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "synth/cast.hpp"

namespace slambed::synth {

/// A furnished room around the world's origin: x and y horizontal, z up, floor at z = 0.
struct RoomOptions {
  std::uint64_t seed = 1;
  double half_x_m = 4.5, half_y_m = 3.9, height_m = 2.9;
  int moving_objects = 0;    ///< people-sized figures that walk around the tables
  double clearance_m = 0.3;  ///< furniture nearer to the camera path is left out
  double texel_scale = 1;    ///< larger: coarser textures, faster to build
  int threads = 1;           ///< does not change the result
};

/// Builds a room with tables in the middle and shelves, cabinets, pictures, boxes and seats around
/// them. Places in `kept_clear` (camera and feet of the cast) stay free of furniture.
std::shared_ptr<const Scene> make_room(const RoomOptions& options, std::span<const Vec3> kept_clear,
                                       std::span<const Figure> cast = {});

}  // namespace slambed::synth
