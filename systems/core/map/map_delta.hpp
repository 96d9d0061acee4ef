// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "map/elements.hpp"

namespace slambed {

struct NewKeyFrame {
  KeyFrameId id;
  std::uint64_t frame_index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
  SE3 T_cw;
  std::vector<MapPointId> points;  ///< per feature
  KeyFrameId parent;               ///< none: chosen from covisibility
  std::uint32_t version = 0;
  /// False: of the points that it lists only those that it made count it as an observation
  /// (Edge-SLAM's mobile, whose mapper is elsewhere). Not sent: it concerns the map at hand.
  bool observes_known = true;
};

struct KeyFramePose {
  KeyFrameId id;
  SE3 T_cw;
  std::uint32_t version = 0;
};

/// A whole point without its observations; those follow from keyframes and attachments.
struct NewPoint {
  MapPointId id;
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  Appearance appearance;
  KeyFrameId reference, first_keyframe;
  std::uint32_t visible = 1, found = 1;
  std::uint32_t version = 0;
};

struct PointPosition {
  MapPointId id;
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  std::uint32_t version = 0;
};

struct ObservationEdit {
  KeyFrameId keyframe;
  std::uint16_t feature = 0;
  MapPointId point;
};

struct PointFusion {
  MapPointId gone, survivor;
};

/// How often a point should have been seen and was found (ORB-SLAM2's mnVisible and mnFound), as
/// absolute counters, so that applying them twice changes nothing.
struct PointObservationCounts {
  MapPointId id;
  std::uint32_t visible = 0, found = 0;
};

/// One change to a map: what a module hands on, what crosses the network, what a replay logs.
/// Lists are applied in the order of declaration. Applying the same delta twice changes nothing; an
/// old version never overwrites a newer one; edits of elements that are gone are ignored and
/// counted.
struct MapDelta {
  /// Generation of the map, that is of its coordinate frame. A correction of the whole map (a
  /// closed loop) begins the next one; poses and positions that were computed in an older one are
  /// stale.
  std::uint64_t epoch = 0;
  std::vector<NewPoint> points;
  std::vector<NewKeyFrame> keyframes;
  std::vector<ObservationEdit> attach, detach;
  std::vector<PointFusion> fusions;
  std::vector<PointPosition> positions;
  std::vector<KeyFramePose> poses;
  std::vector<PointObservationCounts> observation_counts;
  std::vector<MapPointId> culled_points;
  std::vector<KeyFrameId> culled_keyframes;

  bool empty() const;
};

}  // namespace slambed
