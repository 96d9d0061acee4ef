// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "base/ids.hpp"
#include "geometry/se3.hpp"
#include "map/map_delta.hpp"

namespace slambed {

class Map;

/// What is known of where keyframes are, also of those that are no longer in any map here. A
/// keyframe that nobody placed since its creation stays where it was relative to the keyframe that
/// the camera was tracked against then.
class PoseBook {
 public:
  void created(KeyFrameId keyframe, KeyFrameId reference, const SE3& T_cr, const SE3& T_cw);
  /// A pose that a map holds now; newer knowledge replaces older.
  void placed(KeyFrameId keyframe, const SE3& T_cw);
  /// Every keyframe that is in the book and that the map knows of.
  void placed_in(const Map& map);
  std::optional<SE3> pose(KeyFrameId keyframe) const;
  std::vector<KeyFrameId> keyframes() const;  ///< ascending
  void clear() { entries_.clear(); }

 private:
  struct Entry {
    SE3 T_cw;  ///< as placed, or as created
    bool placed = false;
    KeyFrameId reference;
    SE3 T_cr;
  };
  std::map<KeyFrameId, Entry> entries_;
};

/// The poses of all tracked frames; the final trajectory follows later corrections of the map.
class PoseLog {
 public:
  void add(std::int64_t recorded_ns, const SE3& T_cw, KeyFrameId reference, const SE3& T_cr);
  /// The map starts again: as ORB-SLAM2's, the trajectory does too.
  void clear() { poses_.clear(); }
  std::size_t size() const { return poses_.size(); }

  /// TUM format, recorded time, camera to world: as it was when each frame was tracked.
  void write_live(const std::filesystem::path& path) const;
  /// Likewise, through the keyframes' poses in the book.
  void write_final(const std::filesystem::path& path, const PoseBook& book) const;

 private:
  struct Entry {
    std::int64_t recorded_ns = 0;
    SE3 T_cw;
    KeyFrameId reference;
    SE3 T_cr;
  };
  std::vector<Entry> poses_;
};

}  // namespace slambed
