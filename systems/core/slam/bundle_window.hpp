// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "map/map.hpp"
#include "map/slot_table.hpp"
#include "optimize/bundle_adjuster.hpp"

namespace slambed {

/// True if the module that owns the space made the element.
template <typename Tag>
constexpr bool made_by(Id<Tag> id, IdSpace space) {
  return id.value >> 56 == static_cast<std::uint64_t>(space);
}

/// Which part of the map a window may use and move.
struct BundleLimits {
  /// Leaves out keyframes before this sequence time, even as fixed ones: they would pull the others
  /// back to where they were before a correction.
  double since_s = -std::numeric_limits<double>::infinity();
  KeyFrameId held{};                 ///< fixed in addition to the origin; may be none
  std::optional<IdSpace> movable{};  ///< only keyframes of this module move; nothing: all may
  /// Best covisibles of the keyframe that may move, and further ones that take part as fixed. Where
  /// keyframes are dense, a point has tens of observers, which all repeat the same. Nothing: all
  /// covisibles move, and everybody else who sees their points is fixed, as in ORB-SLAM2.
  struct Size {
    std::size_t moving = 0, fixed = 0;
  };
  std::optional<Size> size{};
};

/// The part of the map that a local bundle adjustment moves: a keyframe, its covisibles, and the
/// points they see. Every other keyframe that sees those points is fixed, as is the origin.
class BundleWindow {
 public:
  /// Memory that is reused from one window to the next.
  struct Scratch {
    struct Mark {
      std::uint32_t run = 0, place = 0;
    };
    std::uint32_t run = 0;
    SlotTable<KeyFrameId, Mark> keyframes;
    SlotTable<MapPointId, Mark> points;
    std::vector<const FeatureSet*> features;  ///< per pose, while the map is read
  };

  /// Nothing when the keyframe is gone, fewer than three keyframes exist, or no pose can move.
  static std::optional<BundleWindow> around(const Map& map, KeyFrameId keyframe,
                                            const BundleOptions& options, Scratch& scratch,
                                            const BundleLimits& limits = {});

  bool step();
  /// Size of the problem, for the cost model of virtual time.
  std::size_t observations() const { return features_.size(); }
  /// Returns the result so far: poses and positions with their versions increased by one, outliers
  /// detached. Empty before the robust stage is done.
  MapDelta result() const;

 private:
  struct Pose {
    KeyFrameId id;
    std::uint32_t version = 0;
  };
  struct Point {
    MapPointId id;
    std::uint32_t version = 0;
  };

  std::vector<Pose> poses_;
  std::vector<Point> points_;
  std::vector<std::uint16_t> features_;  ///< per observation of the problem
  std::uint64_t epoch_ = 0;
  std::unique_ptr<BundleAdjuster> adjuster_;
};

}  // namespace slambed
