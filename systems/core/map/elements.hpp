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

/// Keyframe "keyframe" sees a point as its feature number "feature". What redundancy asks of that
/// feature is kept beside it: looking it up among the keyframe's features would cost three loads
/// from far apart for each observation.
struct Observation {
  KeyFrameId keyframe;
  std::uint16_t feature = 0;
  std::uint8_t octave = 0;
  /// As in MapPoint::weight. None: the keyframe lists the point and is no evidence for it
  /// (NewKeyFrame::observes_known); neither covisibility nor appearance follows from it.
  std::uint8_t weight = 0;
};

/// How a point looks; derived from its observations, carried along where those are not all known.
struct Appearance {
  Descriptor descriptor{};
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< mean unit viewing direction
  float min_distance_m = 0, max_distance_m = 0;      ///< scale-invariance range
};

struct MapPoint {
  MapPointId id;
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  Appearance appearance;
  KeyFrameId reference;  ///< its octave defines the distance range
  KeyFrameId first_keyframe;
  std::vector<Observation> observations;  ///< ordered by keyframe id
  /// Stereo/RGB-D observations count 2, monocular ones 1 (ORB-SLAM2's nObs).
  int weight = 0;
  /// Observation counts: frames in which it should have been seen, and in which it was found
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
  std::vector<MapPointId> points;     ///< per feature; none where unmatched
  std::vector<Covisible> connected;   ///< every weight >= 1, ascending by id
  std::vector<Covisible> covisibles;  ///< weight >= 15 (or the best one), heaviest first
  KeyFrameId parent;                  ///< spanning tree
  std::vector<KeyFrameId> children;
  std::uint32_t version = 0;  ///< of T_cw
};

}  // namespace slambed
