// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "synth/actor.hpp"
#include "synth/camera_path.hpp"

namespace slambed::synth {

/// Options for the people in a room.
struct CastOptions {
  int people = 0;
  /// walking: along the near side of the tables (y < 0) and around them, with pauses.
  /// crossing: along the near side only, slowly through its middle.
  /// sitting: on the near side, with gestures.
  /// mixed: walking, standing or sitting anywhere in the room.
  std::string activity = "walking";
  std::uint64_t seed = 1;
  double duration_s = 30;
};

/// One person of the cast.
struct Figure {
  std::shared_ptr<const Actor> actor;
  std::uint64_t seed = 0;  ///< for the clothes
};

std::vector<std::string> activity_names();

/// Places people so that nobody comes within 0.7 m of the camera. Throws bad_input if it finds no
/// such place.
std::vector<Figure> make_cast(const CastOptions& options, const CameraPath& camera);

/// Returns where the cast's feet are over time, which must stay free of furniture.
std::vector<Vec3> footprints(std::span<const Figure> cast, double duration_s);

}  // namespace slambed::synth
