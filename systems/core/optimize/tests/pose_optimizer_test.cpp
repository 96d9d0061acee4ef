// SPDX-License-Identifier: Apache-2.0
#include "optimize/pose_optimizer.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "optimize/tests/scene.hpp"

namespace slambed {
namespace {

using scene::make_pose_scene;

PoseResult solve(const scene::PoseScene& s, std::vector<std::uint8_t>& outlier,
                 PoseOptions options = {}) {
  return PoseOptimizer(options).solve(scene::camera(), s.start, s.observations, outlier);
}

TEST(PoseOptimizerTest, NoiseFreePoseIsExact) {
  for (const double mono_share : {0.0, 0.5, 1.0}) {
    const auto s = make_pose_scene(200, {.seed = 2, .noise_px = 0, .mono_share = mono_share});
    std::vector<std::uint8_t> outlier;
    const PoseResult result = solve(s, outlier);
    // Pixels are 32-bit floats, accurate to 3e-5 px or about 1e-7 rad.
    EXPECT_LT(scene::rotation_error_rad(result.T_cw, s.truth), 1e-6);
    EXPECT_LT(scene::position_error_m(result.T_cw, s.truth), 1e-6);
    EXPECT_EQ(result.inliers, 200);
    EXPECT_LT(result.cost, 1e-5);
  }
}

TEST(PoseOptimizerTest, OnePixelOfNoiseCostsMillimetres) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto s = make_pose_scene(500, {.seed = seed, .mono_share = 0.3});
    std::vector<std::uint8_t> outlier;
    const PoseResult result = solve(s, outlier);
    EXPECT_LT(scene::rotation_error_rad(result.T_cw, s.truth), 2e-3);
    EXPECT_LT(scene::position_error_m(result.T_cw, s.truth), 6e-3);
    EXPECT_GT(result.inliers, 440);  // the chi-square test rejects 5 % of the inliers
    EXPECT_LT(result.inliers, 500);
  }
}

TEST(PoseOptimizerTest, FindsOutliersAndIsNotMovedByThem) {
  for (const double share : {0.05, 0.1, 0.2}) {
    for (unsigned seed = 0; seed < 5; ++seed) {
      const auto s =
          make_pose_scene(400, {.seed = seed, .outlier_share = share, .mono_share = 0.2});
      std::vector<std::uint8_t> outlier;
      const PoseResult result = solve(s, outlier);
      EXPECT_LT(scene::rotation_error_rad(result.T_cw, s.truth), 3e-3);
      EXPECT_LT(scene::position_error_m(result.T_cw, s.truth), 1e-2);
      int good = 0, good_marked = 0;
      for (std::size_t i = 0; i < outlier.size(); ++i) {
        EXPECT_TRUE(outlier[i] || !s.outlier[i]) << i;
        if (!s.outlier[i]) ++good, good_marked += outlier[i];
      }
      EXPECT_LT(good_marked, 0.1 * good);
    }
  }
}

TEST(PoseOptimizerTest, ReportsInliersAndCostOfItsOwnAnswer) {
  const auto s = make_pose_scene(300, {.seed = 4, .outlier_share = 0.1, .mono_share = 0.4});
  std::vector<std::uint8_t> outlier;
  const PoseResult result = solve(s, outlier);
  double cost = 0;
  int inliers = 0;
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    const double chi2 = scene::chi2(result.T_cw, s.observations[i]);
    EXPECT_EQ(outlier[i] == 0, chi2 <= scene::limit(s.observations[i].right_u));
    if (!outlier[i]) cost += chi2, ++inliers;
  }
  EXPECT_EQ(result.inliers, inliers);
  EXPECT_NEAR(result.cost, cost, 1e-9 * cost);
}

TEST(PoseOptimizerTest, ConvergesFromFarAway) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const auto s = make_pose_scene(300, {.seed = seed, .outlier_share = 0.1, .pose_error = 0.15});
    std::vector<std::uint8_t> outlier;
    EXPECT_LT(scene::position_error_m(solve(s, outlier).T_cw, s.truth), 1e-2) << seed;
  }
}

TEST(PoseOptimizerTest, AnObservationThatFailedCanComeBack) {
  // One iteration per round does not converge, so the first round drops good observations. Without
  // the gross errors, later rounds get closer.
  const auto s =
      make_pose_scene(300, {.seed = 5, .noise_px = 0.3, .outlier_share = 0.2, .pose_error = 0.1});
  std::vector<std::uint8_t> first, last;
  solve(s, first, {.rounds = 1, .iterations = 1});
  solve(s, last, {.rounds = 4, .iterations = 1});
  int came_back = 0;
  for (std::size_t i = 0; i < first.size(); ++i) came_back += first[i] && !last[i];
  EXPECT_GT(came_back, 20);
}

TEST(PoseOptimizerTest, EarlyStopStaysClose) {
  const auto s = make_pose_scene(500, {.seed = 6, .outlier_share = 0.1, .mono_share = 0.3});
  std::vector<std::uint8_t> early_outlier, full_outlier;
  const PoseResult early = solve(s, early_outlier);
  const PoseResult full = solve(s, full_outlier, {.relative_stop = 0});
  EXPECT_LT(scene::position_error_m(early.T_cw, full.T_cw), 1e-3);
  EXPECT_NEAR(early.inliers, full.inliers, 3);
}

TEST(PoseOptimizerTest, SameInputSameBits) {
  const auto s = make_pose_scene(333, {.seed = 8, .outlier_share = 0.1, .mono_share = 0.3});
  std::vector<std::uint8_t> a_outlier, b_outlier(1000, 7);
  const PoseResult a = solve(s, a_outlier), b = solve(s, b_outlier);
  EXPECT_EQ(std::memcmp(&a.T_cw, &b.T_cw, sizeof(SE3)), 0);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a_outlier, b_outlier);
}

}  // namespace
}  // namespace slambed
