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

/// Who is in a room besides the camera.
struct CastOptions {
  int people = 0;
  /// walking: along the tables' near side (y < 0) and around them, with rests; crossing: the same
  /// side alone, slowly through its middle; sitting: there, with gestures; mixed: anything
  /// anywhere.
  std::string activity = "walking";
  std::uint64_t seed = 1;
  double duration_s = 30;
};

/// One person of the cast.
struct Figure {
  std::shared_ptr<const Actor> actor;
  std::uint64_t seed = 0;  ///< of the clothes
};

std::vector<std::string> activity_names();

/// Places people so that none comes nearer than 0.7 m to the camera; throws when there is no such
/// place.
std::vector<Figure> make_cast(const CastOptions& options, const CameraPath& camera);

/// Where their feet are over time: no furniture belongs there.
std::vector<Vec3> footprints(std::span<const Figure> cast, double duration_s);

}  // namespace slambed::synth
