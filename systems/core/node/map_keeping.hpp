// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "node/playback.hpp"
#include "node/policy.hpp"
#include "sequence/prepared_sequence.hpp"
#include "wire/hello.hpp"

namespace slambed {

/// Throws bad_input if the map was made with another camera or pyramid than the played one.
void require_same_rig(const wire::SensorInfo& stored, const wire::SensorInfo& played,
                      const std::filesystem::path& map);

/// Map files of a run: the one it starts from and the one it saves (docs/reference/sequence.md,
/// "Map file").
class MapKeeping {
 public:
  MapKeeping(const System& system, const Parameters& parameters, const PreparedSequence& sequence,
             const Playlist& playlist, const wire::SensorInfo& sensor);

  /// Loads the requested map, with times relative to this run's time zero; null if none is
  /// requested. Throws bad_input for a damaged or empty map, or one of another camera or pyramid.
  std::shared_ptr<Map> prior() const;
  /// Writes map.slm into the folder if the system saves its map and the map is not empty.
  void save(const Map& map, const std::filesystem::path& folder) const;

 private:
  std::filesystem::path prior_;
  bool save_ = false;
  wire::SensorInfo sensor_;
  std::string sequence_;
  double time_zero_s_ = 0;  ///< recorded time of the first played frame
};

}  // namespace slambed
