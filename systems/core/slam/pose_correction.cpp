// SPDX-License-Identifier: Apache-2.0
#include "slam/pose_correction.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <numbers>

namespace slambed {
namespace {

/// Interpolates a correction: linearly for the camera center, about one axis for the rotation.
class PartialMove {
 public:
  PartialMove(const SE3& T_cw_before, const SE3& T_cw_after)
      : before_(T_cw_before), T_wc_(T_cw_before.inverse()), after_(T_cw_after) {
    const SE3 T_wc_after = T_cw_after.inverse();
    step_m_ = T_wc_after.t - T_wc_.t;
    turn_ = SE3(T_wc_after.R * T_wc_.R.transpose(), Eigen::Vector3d::Zero()).log().tail<3>();
  }

  /// T_new_old of the world for this share of the move; 0 to 1.
  SE3 at(double share) const {
    if (share >= 1) return (after_.inverse() * before_).normalized();
    Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
    twist.tail<3>() = share * turn_;
    const SE3 T_wc(SE3::exp(twist).R * T_wc_.R, T_wc_.t + share * step_m_);
    return (T_wc * before_).normalized();
  }
  double distance_m() const { return step_m_.norm(); }
  double rotation_deg() const { return turn_.norm() * 180 / std::numbers::pi; }

 private:
  SE3 before_, T_wc_, after_;
  Eigen::Vector3d step_m_, turn_;
};

}  // namespace

std::optional<PoseCorrection> correct_pose(const MapView& view, KeyFrameId id, const SE3& T_cw,
                                           const CorrectionWindow& window) {
  const KeyFrame* corrected = view.keyframe(id);
  const auto now = view.pose_of(id);
  if (!now) return std::nullopt;
  const PartialMove move(*now, T_cw);
  PoseCorrection correction;
  correction.keyframe = id;
  correction.T_new_old = move.at(1);
  correction.magnitude_m = move.distance_m();
  correction.rotation_deg = move.rotation_deg();
  correction.delta.epoch = view.epoch() + 1;
  // A culled keyframe has no timestamp any more, so the newest one up to its id gives the time.
  double corrected_s = -std::numeric_limits<double>::infinity();
  for (const KeyFrameId other : view.keyframe_ids())
    if (other <= id) corrected_s = std::max(corrected_s, view.keyframe(other)->timestamp_s);
  if (corrected) corrected_s = corrected->timestamp_s;
  correction.since_s = corrected_s - window.window_s;

  const auto share_at = [&](double time_s) {
    if (time_s >= corrected_s) return 1.0;
    if (time_s < correction.since_s) return 0.0;
    return window.graded && window.window_s > 0 ? 1 - (corrected_s - time_s) / window.window_s
                                                : 1.0;
  };
  for (const KeyFrameId other : view.keyframe_ids()) {
    const KeyFrame& keyframe = *view.keyframe(other);
    const double share = other == id ? 1 : share_at(keyframe.timestamp_s);
    if (share <= 0) continue;
    const SE3 T_new_old = share >= 1 ? correction.T_new_old : move.at(share);
    const SE3 after = other == id ? T_cw : (keyframe.T_cw * T_new_old.inverse()).normalized();
    correction.delta.poses.push_back({other, after, keyframe.version + 1});
    for (const MapPointId point_id : keyframe.points) {
      const MapPoint* point = point_id ? view.point(point_id) : nullptr;
      // Observations are ordered by keyframe id, and ids grow with time: the last is the newest.
      if (!point || point->observations.back().keyframe != other) continue;
      correction.delta.positions.push_back({point_id, T_new_old * point->p_w, point->version + 1});
    }
  }
  return correction;
}

}  // namespace slambed
