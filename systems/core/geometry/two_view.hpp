// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/two_view_models.hpp"

namespace slambed {

/// ORB-SLAM's limits.
struct TwoViewOptions {
  int iterations = 200;
  double homography_share = 0.40;  ///< R_H above which the scene counts as flat
  double least_parallax_deg = 1;
  int least_points = 50;
  double least_share = 0.9;   ///< of the model's inliers that must become points
  double rival_motion = 0.7;  ///< another motion with this share of the points: ambiguous
  double rival_plane = 0.75;  ///< the same for a homography
  std::uint64_t seed = 1;
};

enum class TwoViewOutcome {
  kFound,
  kTooFewPairs,
  kNoModel,       ///< neither model explains anything
  kTooFewPoints,  ///< the best motion puts too little in front of both cameras
  kAmbiguous,     ///< two motions explain the pairs about equally well
  kLowParallax
};
enum class TwoViewModel { kHomography, kFundamental };

struct TwoViewResult {
  TwoViewOutcome outcome = TwoViewOutcome::kTooFewPairs;
  TwoViewModel model = TwoViewModel::kFundamental;
  double homography_share = 0;       ///< R_H = S_H / (S_H + S_F)
  SE3 T_21;                          ///< of unit translation
  std::vector<Eigen::Vector3d> p_1;  ///< per pair, in the first camera's frame
  std::vector<std::uint8_t> good;    ///< per pair: p_1 is a point worth keeping
  int points = 0;
  double parallax_deg = 0;  ///< exceeded by fifty points and by a quarter of them

  explicit operator bool() const { return outcome == TwoViewOutcome::kFound; }
};

/// The motion between two views of an unknown scene and the points seen in both: a homography and a
/// fundamental matrix are fitted side by side, the better founded one is taken apart, and of its
/// motions the one that puts the points in front of both cameras is taken if no other comes close
/// (Mur-Artal, Montiel, Tardos, T-RO 2015, section IV).
TwoViewResult reconstruct_two_views(const Camera& camera, std::span<const PixelPair> pairs,
                                    const TwoViewOptions& options = {});

}  // namespace slambed
