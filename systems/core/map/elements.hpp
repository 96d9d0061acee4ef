// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/ids.hpp"
#include "features/feature_set.hpp"
#include "geometry/se3.hpp"

namespace slambed {

/// A keyframe sees a point as its feature number `feature`. Octave and weight are copied from it,
/// because keyframe culling would otherwise need three scattered loads per observation.
struct Observation {
  KeyFrameId keyframe;
  std::uint16_t feature = 0;
  std::uint8_t octave = 0;
  /// Contribution to MapPoint::weight. 0: the keyframe lists the point without observing it
  /// (NewKeyFrame::observes_known), which adds nothing to covisibility or appearance.
  std::uint8_t weight = 0;
};

/// Appearance of a point, derived from its observations. Deltas carry it, because the receiver may
/// not know all observations.
struct Appearance {
  Descriptor descriptor{};
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< mean unit viewing direction
  float min_distance_m = 0, max_distance_m = 0;      ///< scale-invariance range
};

struct MapPoint {
  MapPointId id;
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  Appearance appearance;
  KeyFrameId reference;  ///< the octave of its feature defines the distance range
  KeyFrameId first_keyframe;
  std::vector<Observation> observations;  ///< ordered by keyframe id
  /// Stereo/RGB-D observations count 2, monocular ones 1 (ORB-SLAM2's nObs).
  int weight = 0;
  /// Number of frames in which the point should have been visible, and in which it was found
  /// (ORB-SLAM2's mnVisible and mnFound).
  std::uint32_t visible = 1, found = 1;
  std::uint32_t version = 0;  ///< of p_w
};

struct Covisible {
  KeyFrameId id;
  int weight = 0;  ///< shared map points
};

struct KeyFrame {
  KeyFrameId id;
  std::uint64_t frame_index = 0;
  double timestamp_s = 0;                      ///< sequence time
  std::shared_ptr<const FeatureSet> features;  ///< immutable
  SE3 T_cw;
  std::vector<MapPointId> points;     ///< per feature; none when unmatched
  std::vector<Covisible> connected;   ///< every weight >= 1, ascending by id
  std::vector<Covisible> covisibles;  ///< weight >= 15 (or the best one), heaviest first
  KeyFrameId parent;                  ///< spanning tree
  std::vector<KeyFrameId> children;
  std::uint32_t version = 0;  ///< of T_cw
};

}  // namespace slambed
