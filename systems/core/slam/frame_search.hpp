// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "optimize/pose_optimizer.hpp"
#include "slam/local_view.hpp"
#include "slam/matching.hpp"

namespace slambed {

/// A map point together with the feature that saw it in another image (last frame or keyframe).
struct SeenPoint {
  MapPointId id;
  Eigen::Vector3d p_w = Eigen::Vector3d::Zero();
  Descriptor descriptor{};
  float angle_deg = 0;
  std::uint8_t octave = 0;
  float min_distance_m = 0, max_distance_m = 0;
};

/// The points a keyframe sees, copied in one short read; empty when it is not there.
void copy_seen_points(const Map& map, KeyFrameId keyframe, std::vector<SeenPoint>& out);

/// The ways of finding map points in a frame, and the pose that follows. Keeps scratch memory.
class FrameSearch {
 public:
  /// Motion model: the last frame's points around where frame.T_cw predicts them. T_lw is the last
  /// frame's pose: moving forward, things grow and lower octaves are left out. Replaces all
  /// matches.
  int match_last_frame(std::span<const SeenPoint> points, const SE3& T_lw, float radius_px,
                       Frame& frame);
  /// A keyframe's points by descriptor alone. Replaces all matches.
  int match_by_descriptor(std::span<const SeenPoint> points, float ratio, Frame& frame);
  /// Adds a keyframe's points around where frame.T_cw expects them; max_distance in bits.
  int add_projected(std::span<const SeenPoint> points, float radius_px, int max_distance,
                    Frame& frame);
  /// Adds points of the local map; radius_factor widens the windows. Counts observations (found,
  /// visible): every point that should be seen is "visible".
  int add_local(LocalView& local, float radius_factor, Frame& frame);

  /// Pose from all matches, marks outliers; returns the number of inliers.
  int optimize_pose(Frame& frame);

 private:
  Matcher matcher_;
  PoseOptimizer optimizer_;
  RotationCheck rotation_;
  std::vector<PoseObservation> observations_;
  std::vector<int> features_;
  std::vector<std::uint8_t> outlier_;
  std::vector<Matcher::Seen> seen_;
  std::vector<MapPointId> known_;
};

}  // namespace slambed
