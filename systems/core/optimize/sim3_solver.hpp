// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/sim3.hpp"

namespace slambed {

/// One point seen by two cameras: its position in each camera frame, from that side's map points,
/// and its pixel in each image.
struct Sim3Match {
  Eigen::Vector3d p_1, p_2;
  double u_1 = 0, v_1 = 0, u_2 = 0, v_2 = 0;
  double inv_sigma2_1 = 1, inv_sigma2_2 = 1;  ///< of the pixels, 1 / px^2
};

/// Defaults are the limits of ORB-SLAM2.
struct Sim3Options {
  bool fix_scale = true;  ///< both maps are metric
  int max_iterations = 300;
  double confidence = 0.99;
  double sample_chi2 = 9.210;  ///< inlier limit of a sample: two degrees of freedom, 1 %
  double refine_chi2 = 10;     ///< inlier limit and Huber limit of the refinement
  int robust_iterations = 5;
  int final_iterations = 10;  ///< after rejecting matches, else robust_iterations
  std::uint64_t seed = 1;
};

struct Sim3Result {
  Sim3 S_12;                         ///< p_1 ~ S_12 * p_2
  std::vector<std::uint8_t> inlier;  ///< per match: inlier in both images
  int inliers = 0;
};

/// Estimates the similarity between two camera frames from matches with outliers. RANSAC over
/// samples of three, aligned in closed form (Umeyama) and scored by reprojection in both images.
/// Returns nothing for fewer than three matches or inliers.
std::optional<Sim3Result> solve_sim3_ransac(const Camera& camera,
                                            std::span<const Sim3Match> matches,
                                            const Sim3Options& options = {});

/// Minimizes the Huber reprojection error in both images from `start`, rejects outliers and
/// minimizes again. All matches start as inliers.
Sim3Result refine_sim3(const Camera& camera, std::span<const Sim3Match> matches, const Sim3& start,
                       const Sim3Options& options = {});

/// Chi-square of a match in the first and the second image; infinite behind a camera.
struct Sim3Errors {
  double first = 0, second = 0;
};
Sim3Errors sim3_errors(const Camera& camera, const Sim3Match& match, const Sim3& S_12,
                       const Sim3& S_21);

}  // namespace slambed
