// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/two_view_models.hpp"

namespace slambed {

/// Defaults are the limits of ORB-SLAM.
struct TwoViewOptions {
  int iterations = 200;
  double homography_share = 0.40;  ///< the scene is planar when R_H is above this
  double least_parallax_deg = 1;
  int least_points = 50;
  double least_share = 0.9;   ///< of the model's inliers that must become points
  double rival_motion = 0.7;  ///< ambiguous when another motion explains this share of the points
  double rival_plane = 0.75;  ///< the same limit for a homography
  std::uint64_t seed = 1;
};

enum class TwoViewOutcome {
  kFound,
  kTooFewPairs,
  kNoModel,       ///< neither model explains anything
  kTooFewPoints,  ///< the best motion puts too few points in front of both cameras
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
  std::vector<std::uint8_t> good;    ///< per pair: p_1 is valid
  int points = 0;
  double parallax_deg = 0;  ///< exceeded by at least fifty points and a quarter of them

  explicit operator bool() const { return outcome == TwoViewOutcome::kFound; }
};

/// Estimates the motion between two views of an unknown scene and the points seen in both. Fits a
/// homography and a fundamental matrix, selects one by its score and decomposes it. Takes the
/// motion that puts most points in front of both cameras, unless another comes close (Mur-Artal,
/// Montiel, Tardos, T-RO 2015, section IV).
TwoViewResult reconstruct_two_views(const Camera& camera, std::span<const PixelPair> pairs,
                                    const TwoViewOptions& options = {});

}  // namespace slambed
