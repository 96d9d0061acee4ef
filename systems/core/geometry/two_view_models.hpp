// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.hpp"

namespace slambed {

/// A match between two images, in ideal pixels.
struct PixelPair {
  Eigen::Vector2d first, second;
};

/// Fits a homography with second ~ H * first by the normalized DLT (Hartley and Zisserman, chapter
/// 4). It is exact for four pairs and minimizes the algebraic error for more. Returns nothing when
/// the pairs do not determine one.
std::optional<Eigen::Matrix3d> fit_homography(std::span<const PixelPair> pairs);

/// Fits a fundamental matrix of rank 2 with second^T F first = 0 by the normalized eight-point
/// algorithm (same book, chapter 11). Returns nothing for fewer than eight or degenerate pairs.
std::optional<Eigen::Matrix3d> fit_fundamental(std::span<const PixelPair> pairs);

/// Squared errors of one pair, px^2: in the second image and in the first.
struct PairError {
  double second = 0, first = 0;
};
/// Distances between the transferred and the observed point (symmetric transfer error).
PairError homography_error(const Eigen::Matrix3d& H, const Eigen::Matrix3d& H_inverse,
                           const PixelPair& pair);
/// Distances to the epipolar lines.
PairError fundamental_error(const Eigen::Matrix3d& F, const PixelPair& pair);

/// Decomposes a homography of normalized image coordinates, with the sign that keeps points in
/// front. Returns four motions T_21 of unit translation, two of which have the plane in front (Ma,
/// Soatto, Kosecka, Sastry, "An invitation to 3-D vision", section 5.3). Returns none for a pure
/// rotation.
std::vector<SE3> homography_motions(const Eigen::Matrix3d& H);

/// Returns the four motions T_21 of unit translation that an essential matrix allows.
std::vector<SE3> essential_motions(const Eigen::Matrix3d& E);

}  // namespace slambed
