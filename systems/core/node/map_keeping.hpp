// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "node/playback.hpp"
#include "node/policy.hpp"
#include "sequence/prepared_sequence.hpp"
#include "wire/hello.hpp"

namespace slambed {

/// bad_input when the map was made with another camera or pyramid than the one that is played.
void require_same_rig(const wire::SensorInfo& stored, const wire::SensorInfo& played,
                      const std::filesystem::path& map);

/// Maps that outlive a run: the one it starts from, the one it leaves
/// (docs/reference/sequence.md).
class MapKeeping {
 public:
  MapKeeping(const System& system, const Parameters& parameters, const PreparedSequence& sequence,
             const Playlist& playlist, const wire::SensorInfo& sensor);

  /// The map asked for, its times counted from this run's time zero; null when none is.
  /// bad_input for a file that is no whole map, or one made with another camera or pyramid.
  std::shared_ptr<Map> prior() const;
  /// Leaves map.slm in the folder where that is asked for and there is anything to leave.
  void save(const Map& map, const std::filesystem::path& folder) const;

 private:
  std::filesystem::path prior_;
  bool save_ = false;
  wire::SensorInfo sensor_;
  std::string sequence_;
  double time_zero_s_ = 0;  ///< recorded time of the first played frame
};

}  // namespace slambed
