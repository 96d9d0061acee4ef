// SPDX-License-Identifier: Apache-2.0
#include "synth/skeleton.hpp"

#include <algorithm>

#include "synth/random.hpp"

namespace slambed::synth {
namespace {

/// Rotation about the y axis (left): a hanging limb swings forward, an upright part leans back.
Eigen::Matrix3d swing(double degrees) {
  const SinCos a = sincos_deg(degrees);
  Eigen::Matrix3d R;
  R << a.cos, 0, -a.sin, 0, 1, 0, a.sin, 0, a.cos;
  return R;
}

/// Rotation about the x axis (ahead): a hanging limb moves to the left.
Eigen::Matrix3d sideways(double degrees) {
  const SinCos a = sincos_deg(degrees);
  Eigen::Matrix3d R;
  R << 1, 0, 0, 0, a.cos, -a.sin, 0, a.sin, a.cos;
  return R;
}

Eigen::Matrix3d turn(double degrees) {
  const SinCos a = sincos_deg(degrees);
  Eigen::Matrix3d R;
  R << a.cos, -a.sin, 0, a.sin, a.cos, 0, 0, 0, 1;
  return R;
}

}  // namespace

PartPoses place_parts(const Build& b, const Stance& s) {
  PartPoses parts;
  Eigen::Matrix3d root;
  root << s.ahead.x(), -s.ahead.y(), 0, s.ahead.y(), s.ahead.x(), 0, 0, 0, 1;
  parts[kPelvis] = {root, s.pelvis};
  parts[kTorso] = parts[kPelvis] * SE3(turn(s.twist_deg) * swing(-s.lean_deg), Vec3::Zero());
  parts[kHead] =
      parts[kTorso] * SE3(turn(s.head_yaw_deg) * swing(s.head_pitch_deg), Vec3(0, 0, b.neck_m()));
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? 1 : -1;
    const LimbAngles &arm = s.arms[side], &leg = s.legs[side];
    parts[kUpperArm + side] =
        parts[kTorso] * SE3(swing(arm.swing_deg) * sideways(sign * arm.out_deg),
                            Vec3(0, sign * b.half_shoulders_m(), b.shoulder_m()));
    parts[kForearm + side] =
        parts[kUpperArm + side] * SE3(swing(arm.bend_deg), Vec3(0, 0, -b.upper_arm_m()));
    parts[kThigh + side] = parts[kPelvis] * SE3(sideways(sign * leg.out_deg) * swing(leg.swing_deg),
                                                Vec3(0, sign * b.half_hips_m(), 0));
    parts[kShin + side] =
        parts[kThigh + side] * SE3(swing(-leg.bend_deg), Vec3(0, 0, -b.thigh_m()));
    // Keeps the sole about level.
    parts[kFoot + side] = parts[kShin + side] *
                          SE3(swing(0.7 * (leg.bend_deg - leg.swing_deg)), Vec3(0, 0, -b.shin_m()));
  }
  return parts;
}

std::array<Vec3, kKeypoints> keypoints(const Build& b, const PartPoses& parts) {
  const double h = b.height_m;
  std::array<Vec3, kKeypoints> points;
  points[0] = parts[kHead] * Vec3(0.062 * h, 0, 0.092 * h);
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? 1 : -1;
    points[1 + side] = parts[kHead] * Vec3(0.052 * h, sign * 0.018 * h, 0.110 * h);
    points[3 + side] = parts[kHead] * Vec3(0, sign * 0.044 * h, 0.098 * h);
    points[5 + side] = parts[kUpperArm + side].t;
    points[7 + side] = parts[kForearm + side].t;
    points[9 + side] = parts[kForearm + side] * Vec3(0, 0, -b.forearm_m());
    points[11 + side] = parts[kThigh + side].t;
    points[13 + side] = parts[kShin + side].t;
    points[15 + side] = parts[kFoot + side].t;
  }
  return points;
}

double standing_hip_m(const Build& b, const Stance& s) {
  double longest = 0;
  for (const LimbAngles& leg : s.legs)
    longest = std::max(longest, b.thigh_m() * sincos_deg(leg.swing_deg).cos +
                                    b.shin_m() * sincos_deg(leg.swing_deg - leg.bend_deg).cos);
  return longest + b.ankle_m();
}

}  // namespace slambed::synth
