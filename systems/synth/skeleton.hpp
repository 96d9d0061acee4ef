// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "synth/scene.hpp"

namespace slambed::synth {

/// Rigid parts of a figure. A limb's frame has its origin at the joint nearer to the trunk, and the
/// limb extends along -z; trunk and head extend along +z. x is ahead, y to the left.
enum Part {
  kPelvis,
  kTorso,
  kHead,
  kUpperArm,  ///< left, then right; the same for the following parts
  kForearm = kUpperArm + 2,
  kThigh = kForearm + 2,
  kShin = kThigh + 2,
  kFoot = kShin + 2,
  kParts = kFoot + 2
};

/// COCO's order: nose, eyes, ears, shoulders, elbows, wrists, hips, knees, ankles; left first.
inline constexpr int kKeypoints = 17;

/// Size of a figure. Lengths of its parts are fixed shares of its height, which we chose.
struct Build {
  double height_m = 1.75;
  double girth = 1;  ///< relative thickness of every part

  double hip_m() const { return 0.530 * height_m; }  ///< height of the joint, standing straight
  double half_hips_m() const { return 0.052 * height_m; }
  double thigh_m() const { return 0.245 * height_m; }
  double shin_m() const { return 0.246 * height_m; }
  double ankle_m() const { return hip_m() - thigh_m() - shin_m(); }
  double shoulder_m() const { return 0.285 * height_m; }  ///< above the hips
  double half_shoulders_m() const { return 0.105 * height_m; }
  double neck_m() const { return 0.302 * height_m; }  ///< base of the neck above the hips
  double head_m() const { return height_m - hip_m() - neck_m(); }
  double upper_arm_m() const { return 0.170 * height_m; }
  double forearm_m() const { return 0.148 * height_m; }  ///< elbow to wrist
};

/// Joint angles of an arm or a leg: forward swing, sideways, and bend of the elbow or knee.
struct LimbAngles {
  double swing_deg = 0, out_deg = 0, bend_deg = 0;
};

/// Pose of a figure at one moment.
struct Stance {
  Vec3 pelvis = Vec3::Zero();  ///< midpoint of the hip joints in the world
  Vec3 ahead = Vec3::UnitX();  ///< unit vector, level
  double lean_deg = 0, twist_deg = 0, head_yaw_deg = 0, head_pitch_deg = 0;
  std::array<LimbAngles, 2> arms{}, legs{};  ///< left, right
};

using PartPoses = std::array<SE3, kParts>;

/// Returns part to world for every part.
PartPoses place_parts(const Build& build, const Stance& stance);

/// Returns the key points in the world.
std::array<Vec3, kKeypoints> keypoints(const Build& build, const PartPoses& parts);

/// Returns the height of the hips at which the lower foot stands on the floor.
double standing_hip_m(const Build& build, const Stance& stance);

}  // namespace slambed::synth
