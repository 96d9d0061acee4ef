// SPDX-License-Identifier: Apache-2.0
#include "geometry/two_view.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "base/portable_math.hpp"
#include "geometry/random_sample.hpp"
#include "geometry/triangulation.hpp"

namespace slambed {
namespace {

// Chi-square limits at 5 % for a standard deviation of one pixel: two degrees of freedom for a
// homography, one for an epipolar line. Both scores use the same limit, so they are comparable.
constexpr double kChi2Homography = 5.991, kChi2Line = 3.841, kScore = 5.991;
constexpr std::size_t kSample = 8;
constexpr int kMostRefits = 10;
/// Largest squared reprojection error of a counted point: two standard deviations, squared.
constexpr double kLimit_px2 = 4;
/// Rays with a smaller angle than this (0.36 degrees) do not constrain depth.
constexpr double kParallelCosine = 0.99998;
/// Points that must have the parallax: fifty (ORB-SLAM) and a quarter, since we match many more.
constexpr std::size_t kParallaxPoints = 50, kParallaxShare = 4;
constexpr double kDegrees = 57.29577951308232;

struct Model {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  double score = 0;
  std::vector<std::uint8_t> inlier;
  int inliers = 0;
};

/// Scores a model: sums kScore minus the error over the errors below the limit, in both images.
/// error: returns the PairError of a pair.
template <typename Error>
Model judged(const Eigen::Matrix3d& matrix, std::span<const PixelPair> pairs, double limit,
             Error error) {
  Model model{matrix, 0, std::vector<std::uint8_t>(pairs.size()), 0};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const PairError e = error(pairs[i]);
    if (e.second <= limit) model.score += kScore - e.second;
    if (e.first <= limit) model.score += kScore - e.first;
    model.inlier[i] = e.second <= limit && e.first <= limit;
    model.inliers += model.inlier[i];
  }
  return model;
}

Model judged_homography(const Eigen::Matrix3d& H, std::span<const PixelPair> pairs) {
  const Eigen::Matrix3d inverse = H.inverse();
  return judged(H, pairs, kChi2Homography,
                [&](const PixelPair& pair) { return homography_error(H, inverse, pair); });
}

Model judged_fundamental(const Eigen::Matrix3d& F, std::span<const PixelPair> pairs) {
  return judged(F, pairs, kChi2Line,
                [&](const PixelPair& pair) { return fundamental_error(F, pair); });
}

/// Fits a model to `fitted` and replaces the best one if it scores higher; returns whether it did.
template <typename Fit, typename Judge>
bool improve(std::span<const PixelPair> fitted, std::span<const PixelPair> all, Fit fit,
             Judge judge, Model& best) {
  const auto matrix = fit(fitted);
  if (!matrix) return false;
  Model model = judge(*matrix, all);
  if (!(model.score > best.score)) return false;
  best = std::move(model);
  return true;
}

/// Refits the model to all its inliers until the score stops rising.
template <typename Fit, typename Judge>
void refit(std::span<const PixelPair> all, Fit fit, Judge judge, Model& best) {
  std::vector<PixelPair> fitting;
  for (int round = 0; round < kMostRefits; ++round) {
    fitting.clear();
    for (std::size_t i = 0; i < best.inlier.size(); ++i)
      if (best.inlier[i]) fitting.push_back(all[i]);
    if (fitting.size() < kSample || !improve(fitting, all, fit, judge, best)) return;
  }
}

/// Fits both models from the same samples.
struct Models {
  Models(std::span<const PixelPair> pairs, const TwoViewOptions& options) {
    SplitMix64 random(options.seed);
    std::array<PixelPair, kSample> sample;
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      const auto chosen = draw_sample<kSample>(random, pairs.size());
      for (std::size_t i = 0; i < kSample; ++i) sample[i] = pairs[chosen[i]];
      improve(sample, pairs, fit_homography, judged_homography, homography);
      improve(sample, pairs, fit_fundamental, judged_fundamental, fundamental);
    }
    refit(pairs, fit_homography, judged_homography, homography);
    refit(pairs, fit_fundamental, judged_fundamental, fundamental);
  }
  Model homography, fundamental;
};

/// The points triangulated under one motion.
struct Hypothesis {
  SE3 T_21;
  std::vector<Eigen::Vector3d> p_1;
  std::vector<std::uint8_t> good;
  int points = 0;  ///< consistent with the motion, including points without usable depth
  double parallax_deg = 0;
};

double squared_error(const Camera& camera, const Eigen::Vector3d& p_c,
                     const Eigen::Vector2d& seen) {
  return (camera.project(p_c) - seen).squaredNorm();
}

Hypothesis try_motion(const Camera& camera, std::span<const PixelPair> pairs,
                      std::span<const std::uint8_t> inlier, const SE3& T_21) {
  Hypothesis tried{T_21, std::vector<Eigen::Vector3d>(pairs.size()),
                   std::vector<std::uint8_t>(pairs.size()), 0, 0};
  Eigen::Matrix<double, 3, 4> P1 = Eigen::Matrix<double, 3, 4>::Identity(), P2;
  P2 << T_21.R, T_21.t;
  std::vector<double> cosines;
  const auto normalized = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return {(p.x() - camera.cx) / camera.fx, (p.y() - camera.cy) / camera.fy};
  };
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!inlier[i]) continue;
    const Eigen::Vector2d a = normalized(pairs[i].first), b = normalized(pairs[i].second);
    const auto p_1 = triangulate(P1, P2, a, b);
    if (!p_1) continue;
    const Eigen::Vector3d p_2 = T_21 * *p_1;
    const double cosine =
        p_1->dot(*p_1 - T_21.inverse().t) / (p_1->norm() * (*p_1 - T_21.inverse().t).norm());
    const bool near = cosine < kParallelCosine;
    // Noise can put a very distant point behind a camera, so check only points with parallax.
    if (near && (p_1->z() <= 0 || p_2.z() <= 0)) continue;
    if (!(squared_error(camera, *p_1, pairs[i].first) <= kLimit_px2) ||
        !(squared_error(camera, p_2, pairs[i].second) <= kLimit_px2))
      continue;
    cosines.push_back(cosine);
    tried.p_1[i] = *p_1;
    tried.good[i] = near;
    ++tried.points;
  }
  if (cosines.empty()) return tried;
  const std::size_t rank =
      std::min(std::max(kParallaxPoints, cosines.size() / kParallaxShare), cosines.size() - 1);
  std::nth_element(cosines.begin(), cosines.begin() + static_cast<std::ptrdiff_t>(rank),
                   cosines.end());
  tried.parallax_deg = portable::acos(std::clamp(cosines[rank], -1.0, 1.0)) * kDegrees;
  return tried;
}

Eigen::Matrix3d intrinsics(const Camera& camera) {
  Eigen::Matrix3d K;
  K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  return K;
}

/// Returns the homography of normalized coordinates, with the sign that keeps points in front.
Eigen::Matrix3d calibrated(const Model& model, const Eigen::Matrix3d& K,
                           std::span<const PixelPair> pairs) {
  const Eigen::Matrix3d H = K.inverse() * model.matrix * K, K_inverse = K.inverse();
  int ahead = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!model.inlier[i]) continue;
    const Eigen::Vector3d a = K_inverse * pairs[i].first.homogeneous();
    const Eigen::Vector3d b = K_inverse * pairs[i].second.homogeneous();
    ahead += b.dot(H * a) > 0 ? 1 : -1;
  }
  return ahead >= 0 ? H : -H;
}

}  // namespace

TwoViewResult reconstruct_two_views(const Camera& camera, std::span<const PixelPair> pairs,
                                    const TwoViewOptions& options) {
  TwoViewResult result;
  if (pairs.size() < kSample) return result;
  const Models models(pairs, options);
  const double total = models.homography.score + models.fundamental.score;
  result.outcome = TwoViewOutcome::kNoModel;
  if (!(total > 0)) return result;
  result.homography_share = models.homography.score / total;
  const bool flat = result.homography_share > options.homography_share;
  result.model = flat ? TwoViewModel::kHomography : TwoViewModel::kFundamental;
  const Model& model = flat ? models.homography : models.fundamental;

  const Eigen::Matrix3d K = intrinsics(camera);
  const std::vector<SE3> motions = flat ? homography_motions(calibrated(model, K, pairs))
                                        : essential_motions(K.transpose() * model.matrix * K);
  Hypothesis best;
  int second = 0;
  for (const SE3& motion : motions) {
    Hypothesis tried = try_motion(camera, pairs, model.inlier, motion);
    if (tried.points > best.points) std::swap(tried, best);
    second = std::max(second, tried.points);
  }
  const int wanted = std::max(options.least_points,
                              static_cast<int>(std::ceil(options.least_share * model.inliers)));
  const double rival = flat ? options.rival_plane : options.rival_motion;
  result.points = static_cast<int>(std::count(best.good.begin(), best.good.end(), 1));
  result.parallax_deg = best.parallax_deg;
  result.outcome = TwoViewOutcome::kFound;
  if (best.points < wanted || result.points < options.least_points)
    result.outcome = TwoViewOutcome::kTooFewPoints;
  else if (second > rival * best.points)
    result.outcome = TwoViewOutcome::kAmbiguous;
  else if (best.parallax_deg < options.least_parallax_deg)
    result.outcome = TwoViewOutcome::kLowParallax;
  result.T_21 = best.T_21;
  result.p_1 = std::move(best.p_1);
  result.good = std::move(best.good);
  return result;
}

}  // namespace slambed
