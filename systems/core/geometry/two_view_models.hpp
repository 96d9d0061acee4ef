// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.hpp"

namespace slambed {

/// The same thing in two images, ideal pixels.
struct PixelPair {
  Eigen::Vector2d first, second;
};

/// Homography with second ~ H * first, by the normalized linear method (Hartley and Zisserman,
/// chapter 4): exact for four pairs, least squares of the algebraic error for more. Nothing where
/// the pairs do not fix one.
std::optional<Eigen::Matrix3d> fit_homography(std::span<const PixelPair> pairs);

/// Fundamental matrix with second^T F first = 0 and rank 2, by the normalized eight-point method
/// (same book, chapter 11). Nothing with fewer than eight pairs.
std::optional<Eigen::Matrix3d> fit_fundamental(std::span<const PixelPair> pairs);

/// Squared errors of one pair, px^2: in the second image and in the first.
struct PairError {
  double second = 0, first = 0;
};
/// Distances between where H takes a point and where it was seen.
PairError homography_error(const Eigen::Matrix3d& H, const Eigen::Matrix3d& H_inverse,
                           const PixelPair& pair);
/// Distances to the epipolar lines.
PairError fundamental_error(const Eigen::Matrix3d& F, const PixelPair& pair);

/// Motions T_21 of unit translation that a calibrated homography (of normalized image coordinates,
/// positive on what was seen) allows: four, of which two have the plane in front (Ma, Soatto,
/// Kosecka, Sastry, "An invitation to 3-D vision", section 5.3). None for a mere turn.
std::vector<SE3> homography_motions(const Eigen::Matrix3d& H);

/// The four motions T_21 of unit translation that an essential matrix allows.
std::vector<SE3> essential_motions(const Eigen::Matrix3d& E);

}  // namespace slambed
