// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "synth/room.hpp"
#include "synth/sensor.hpp"

namespace slambed::synth {

/// Must change whenever the same options give different bytes.
inline constexpr const char* kGeneratorVersion = "2";

/// Everything that determines a generated sequence.
struct GeneratorOptions {
  std::string id = "synthetic", title = "Generated room";
  std::string sensor = "rgbd";  ///< or "stereo", "mono"
  /// A named path or a TUM-format file in a room; a route (rectangle, circular, block) is driven
  /// through streets.
  std::string trajectory = "spline";
  double seconds = 0;  ///< 0: the path's whole duration
  double fps = 30;
  std::uint64_t seed = 1;
  int width = 640, height = 480;
  int moving_objects = 0;            ///< box figures in a room, oncoming cars in a street
  int people = 0;                    ///< in a room, with moving limbs
  std::string activity = "walking";  ///< of the people (CastOptions)
  bool labels = false;               ///< writes labels.bin: masks and key points of the people
  int open_stretches = 0;            ///< stretches of a street with nothing near the road
  double texel_scale = 1;
  SensorOptions sensor_model;
};

/// Called with the frames done and in total. If it returns false, generation stops and leaves no
/// files.
using Progress = std::function<bool(int done, int total)>;

/// Returns a pinhole camera with a 62.7 degree field of view. rgbd: bf 40 px m as in TUM's
/// settings; stereo: baseline 11 cm. On the road: 84.9 degrees and 12 cm.
Camera generator_camera(const GeneratorOptions& options);

/// Writes a prepared sequence. The bytes depend on the options only, not on the number of threads.
/// extra_source: JSON object that is merged into `source` in sequence.json. Returns false if
/// `progress` stopped it.
bool generate(const GeneratorOptions& options, const std::filesystem::path& folder, int threads,
              const Progress& progress, const std::string& extra_source = "{}");

}  // namespace slambed::synth
