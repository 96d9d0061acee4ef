// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "synth/room.hpp"
#include "synth/sensor.hpp"

namespace slambed::synth {

/// Changes whenever the same options give other bytes.
inline constexpr const char* kGeneratorVersion = "2";

/// Everything a generated sequence depends on.
struct GeneratorOptions {
  std::string id = "synthetic", title = "Generated room";
  std::string sensor = "rgbd";  ///< or "stereo", "mono"
  /// A named path or a TUM-format file in a room; a route (rectangle, circular, block) is driven
  /// through streets.
  std::string trajectory = "spline";
  double seconds = 0;  ///< 0: as long as the path
  double fps = 30;
  std::uint64_t seed = 1;
  int width = 640, height = 480;
  int moving_objects = 0;  ///< box figures in a room, cars that come the other way in a street
  int people = 0;          ///< in a room, with limbs that move
  std::string activity = "walking";  ///< what they do (CastOptions)
  bool labels = false;               ///< writes labels.bin: masks and key points of the people
  int open_stretches = 0;            ///< of a street, with nothing near the road
  double texel_scale = 1;
  SensorOptions sensor_model;
};

/// Called with frames done and frames in all; returning false stops and leaves nothing behind.
using Progress = std::function<bool(int done, int total)>;

/// Pinhole with a 62.7 degree field of view; rgbd: bf 40 px m as in TUM's settings, stereo: 11 cm,
/// mono: none. On the road 84.9 degrees, stereo: 12 cm.
Camera generator_camera(const GeneratorOptions& options);

/// Writes a prepared sequence. The bytes depend on the options only, not on the number of threads.
/// extra_source: a JSON object whose members join `source` in sequence.json. False when stopped.
bool generate(const GeneratorOptions& options, const std::filesystem::path& folder, int threads,
              const Progress& progress, const std::string& extra_source = "{}");

}  // namespace slambed::synth
