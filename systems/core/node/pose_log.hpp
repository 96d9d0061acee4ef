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

/// The latest known poses of keyframes, including those that are no longer in a map here. A
/// keyframe that was never placed keeps its pose relative to its reference at creation.
class PoseBook {
 public:
  void created(KeyFrameId keyframe, KeyFrameId reference, const SE3& T_cr, const SE3& T_cw);
  /// Sets a pose that a map has now; it replaces older ones.
  void placed(KeyFrameId keyframe, const SE3& T_cw);
  /// Places every keyframe of the book that the map knows.
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
  /// After a map reset the trajectory starts again, as in ORB-SLAM2.
  void clear() { poses_.clear(); }
  std::size_t size() const { return poses_.size(); }

  /// Writes TUM format (recorded time, camera to world) with each pose at tracking time.
  void write_live(const std::filesystem::path& path) const;
  /// The same with poses relative to the book's keyframe poses.
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
