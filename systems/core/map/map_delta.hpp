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
  KeyFrameId parent;               ///< none: the map chooses it from covisibility
  std::uint32_t version = 0;
  /// False: only points that this keyframe created count it as an observation (the mobile node of
  /// Edge-SLAM, whose mapper runs on the edge). Not serialized, because it concerns the local map.
  bool observes_known = true;
};

struct KeyFramePose {
  KeyFrameId id;
  SE3 T_cw;
  std::uint32_t version = 0;
};

/// A point without its observations, which follow from keyframes and attachments.
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

/// Number of frames in which a point should have been visible and was found (ORB-SLAM2's mnVisible
/// and mnFound). Absolute counters, so that applying them twice changes nothing.
struct PointObservationCounts {
  MapPointId id;
  std::uint32_t visible = 0, found = 0;
};

/// One change to a map, as modules pass it on, nodes send it and replays log it. Lists are applied
/// in the order of declaration. Applying the same delta twice changes nothing. An old version never
/// overwrites a newer one. Edits of elements that no longer exist are ignored and counted.
struct MapDelta {
  /// Generation of the map's coordinate frame. A correction of the whole map (a closed loop) starts
  /// the next one. Poses and positions computed in an older epoch are stale.
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
