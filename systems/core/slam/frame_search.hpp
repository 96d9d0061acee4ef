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

/// Copies the points that a keyframe sees in one short read; none if the map lacks it.
void copy_seen_points(const Map& map, KeyFrameId keyframe, std::vector<SeenPoint>& out);

/// Searches for map points in a frame and optimizes its pose. Keeps scratch memory.
class FrameSearch {
 public:
  /// Motion model: searches for the last frame's points around their projections with frame.T_cw.
  /// T_lw is the last frame's pose: moving forward, features grow and lower octaves are left out.
  /// Replaces all matches.
  int match_last_frame(std::span<const SeenPoint> points, const SE3& T_lw, float radius_px,
                       Frame& frame);
  /// Matches a keyframe's points by descriptor alone. Replaces all matches.
  int match_by_descriptor(std::span<const SeenPoint> points, float ratio, Frame& frame);
  /// Adds matches of a keyframe's points around their projections with frame.T_cw; max_distance in
  /// bits.
  int add_projected(std::span<const SeenPoint> points, float radius_px, int max_distance,
                    Frame& frame);
  /// Adds matches of local map points; radius_factor widens the windows. Counts every point that
  /// should be seen as visible (ORB-SLAM2's mnVisible).
  int add_local(LocalView& local, float radius_factor, Frame& frame);

  /// Optimizes the pose with all matches and marks outliers; returns the number of inliers.
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
