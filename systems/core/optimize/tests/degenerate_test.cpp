// SPDX-License-Identifier: Apache-2.0
// Solvers must not crash or propagate bad numbers for input without a good solution.
#include <gtest/gtest.h>

#include <limits>

#include "optimize/tests/scene.hpp"

namespace slambed {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfF = std::numeric_limits<float>::infinity();

PoseResult solve(const SE3& start, const std::vector<PoseObservation>& observations,
                 std::vector<std::uint8_t>& outlier, PoseOptions options = {}) {
  return PoseOptimizer(options).solve(scene::camera(), start, observations, outlier);
}

bool finite(const SE3& T) { return T.R.allFinite() && T.t.allFinite(); }

TEST(DegeneratePoseTest, FewerThanThreeObservationsReturnTheStart) {
  for (int count = 0; count < 3; ++count) {
    const auto s = scene::make_pose_scene(count, {});
    std::vector<std::uint8_t> outlier(17, 0);
    const PoseResult result = solve(s.start, s.observations, outlier);
    EXPECT_EQ(result.inliers, 0);
    EXPECT_EQ(result.T_cw.t, s.start.t);
    EXPECT_EQ(outlier, std::vector<std::uint8_t>(count, 1));
  }
}

TEST(DegeneratePoseTest, ThreeToNineObservationsGiveAFinitePose) {
  for (int count = 3; count < 10; ++count) {
    for (const double mono_share : {0.0, 1.0}) {
      const auto s = scene::make_pose_scene(
          count, {.seed = unsigned(count), .noise_px = 0.2, .mono_share = mono_share});
      std::vector<std::uint8_t> outlier;
      const PoseResult result = solve(s.start, s.observations, outlier);
      EXPECT_TRUE(finite(result.T_cw));
      if (count > 4) {
        EXPECT_LT(scene::position_error_m(result.T_cw, s.truth), 0.1);
      }
    }
  }
}

TEST(DegeneratePoseTest, BadNumbersAreOutliersAndHarmNothing) {
  const auto s = scene::make_pose_scene(100, {.seed = 3});
  std::vector<PoseObservation> dirty;
  for (const auto& o : s.observations) {
    dirty.push_back(o);
    PoseObservation bad = o;
    switch (dirty.size() / 2 % 6) {
      case 0:
        bad.p_w.y() = kNan;
        break;
      case 1:
        bad.u = kNanF;
        break;
      case 2:
        bad.v = kInfF;
        break;
      case 3:
        bad.right_u = kNanF;
        break;
      case 4:
        bad.inv_sigma2 = kInfF;
        break;
      case 5:
        bad.inv_sigma2 = 0;
        break;
    }
    dirty.push_back(bad);
  }
  std::vector<std::uint8_t> clean_outlier, dirty_outlier;
  const PoseResult clean = solve(s.start, s.observations, clean_outlier);
  const PoseResult result = solve(s.start, dirty, dirty_outlier);
  EXPECT_EQ(result.inliers, clean.inliers);
  EXPECT_LT(scene::position_error_m(result.T_cw, clean.T_cw), 1e-9);
  for (std::size_t i = 0; i < dirty.size(); ++i) {
    EXPECT_EQ(dirty_outlier[i], i % 2 ? 1 : clean_outlier[i / 2]);
  }
}

TEST(DegeneratePoseTest, HopelessScenesStayFinite) {
  const auto s = scene::make_pose_scene(50, {.seed = 5});
  std::vector<std::uint8_t> outlier;

  auto behind = s.observations;  // all behind the camera
  for (auto& o : behind) o.p_w = s.truth.inverse() * Eigen::Vector3d(0, 0, -2);
  EXPECT_EQ(solve(s.start, behind, outlier).inliers, 0);

  auto same = s.observations;  // one point seen 50 times does not determine the pose
  for (auto& o : same) o = s.observations[0];
  EXPECT_TRUE(finite(solve(s.start, same, outlier).T_cw));

  auto at_center = s.observations;  // on the camera center
  for (auto& o : at_center) o.p_w = s.start.inverse().t;
  EXPECT_TRUE(finite(solve(s.start, at_center, outlier).T_cw));

  SE3 broken = s.start;
  broken.t.x() = kNan;
  EXPECT_EQ(solve(broken, s.observations, outlier).inliers, 0);
  EXPECT_EQ(solve(s.start, s.observations, outlier, {.rounds = 0}).inliers, 0);

  Camera no_camera;  // all zero
  const PoseResult nothing = PoseOptimizer().solve(no_camera, s.start, s.observations, outlier);
  EXPECT_TRUE(finite(nothing.T_cw));
}

TEST(DegeneratePoseTest, AFewPointsBehindTheCameraDoNotHurt) {
  auto s = scene::make_pose_scene(200, {.seed = 6});
  for (int i = 0; i < 20; ++i) {
    s.observations[i].p_w = s.truth.inverse() * Eigen::Vector3d(0.1 * i, 0, -1);
  }
  std::vector<std::uint8_t> outlier;
  const PoseResult result = solve(s.start, s.observations, outlier);
  EXPECT_LT(scene::position_error_m(result.T_cw, s.truth), 0.02);
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(outlier[i]);
}

TEST(DegenerateBundleTest, EmptyProblems) {
  BundleAdjuster nothing{BundleProblem{}};
  EXPECT_FALSE(nothing.step());
  EXPECT_TRUE(nothing.outliers().empty());
  EXPECT_EQ(nothing.robust_cost(), 0);

  auto s = scene::make_bundle_scene(3, 2, 20, 3, {});
  s.problem.observations.clear();
  BundleAdjuster unobserved(s.problem);
  EXPECT_FALSE(unobserved.step());
  EXPECT_EQ(unobserved.problem().T_cw[0].t, s.problem.T_cw[0].t);
}

TEST(DegenerateBundleTest, NoFreePoseMovesOnlyPoints) {
  auto s = scene::make_bundle_scene(3, 3, 50, 4, {.seed = 2});
  s.problem.T_cw = s.true_T_cw;
  for (const int free_poses : {0, -5}) {
    s.problem.free_poses = free_poses;
    BundleAdjuster adjuster(s.problem);
    const double before = adjuster.robust_cost();
    scene::run_to_the_end(adjuster);
    EXPECT_LT(adjuster.robust_cost(), before);
    EXPECT_EQ(adjuster.problem().T_cw[0].t, s.problem.T_cw[0].t);
  }
}

TEST(DegenerateBundleTest, NothingFixedStillConverges) {
  auto s = scene::make_bundle_scene(6, 0, 200, 4, {.seed = 3, .noise_px = 0, .mono_share = 1});
  for (const int free_poses : {6, 1000}) {
    s.problem.free_poses = free_poses;
    BundleAdjuster adjuster(s.problem, {30, 30, 0});
    scene::run_to_the_end(adjuster);
    EXPECT_LT(adjuster.robust_cost(), 1e-3);
    for (const auto& T : adjuster.problem().T_cw) EXPECT_TRUE(finite(T));
  }
}

TEST(DegenerateBundleTest, BadNumbersAreOutliersAndHarmNothing) {
  const auto s = scene::make_bundle_scene(5, 3, 100, 4, {.seed = 4});
  BundleProblem dirty = s.problem;
  dirty.p_w.push_back({kNan, 0, 0});  // a bad point
  dirty.p_w.push_back({0, 0, 3});     // a point without observations
  dirty.T_cw.push_back(SE3());        // a bad fixed pose
  dirty.T_cw.back().t.z() = kNan;
  const auto clean_count = dirty.observations.size();
  dirty.observations.push_back({0, 100, 100, 100, -1, 1});
  dirty.observations.push_back({8, 3, 100, 100, -1, 1});
  dirty.observations.push_back({0, 1, kNanF, 100, -1, 1});
  dirty.observations.push_back({0, 2, 100, 100, kNanF, 1});
  dirty.observations.push_back({0, 3, 100, 100, -1, -1});
  dirty.observations.push_back({900, 3, 100, 100, -1, 1});
  dirty.observations.push_back({0, 900, 100, 100, -1, 1});
  BundleAdjuster a(s.problem), b(dirty);
  scene::run_to_the_end(a), scene::run_to_the_end(b);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(a.problem().T_cw[i].t, b.problem().T_cw[i].t);
  EXPECT_EQ(b.problem().p_w[101], Eigen::Vector3d(0, 0, 3));
  EXPECT_EQ(a.robust_cost(), b.robust_cost());
  const auto outliers = b.outliers();
  ASSERT_EQ(outliers.size(), dirty.observations.size());
  for (std::size_t i = clean_count; i < outliers.size(); ++i) EXPECT_TRUE(outliers[i]);
}

TEST(DegenerateBundleTest, ABadFreePoseStaysAloneInItsTrouble) {
  auto s = scene::make_bundle_scene(5, 3, 200, 5, {.seed = 5});
  s.problem.T_cw[2].t.x() = kNan;
  BundleAdjuster adjuster(s.problem);
  EXPECT_GT(scene::run_to_the_end(adjuster), 1);
  for (int i = 0; i < 5; ++i) {
    if (i == 2) continue;
    EXPECT_LT(scene::position_error_m(adjuster.problem().T_cw[i], s.true_T_cw[i]), 0.03);
  }
}

TEST(DegenerateBundleTest, PointsBehindOrSeenOnceStayFinite) {
  auto s = scene::make_bundle_scene(5, 3, 100, 4, {.seed = 6});
  for (int i = 0; i < 10; ++i) s.problem.p_w[i].z() = -3;  // behind every camera
  s.problem.p_w.push_back({0.3, 0, 3});
  const auto lonely = static_cast<std::uint32_t>(s.problem.p_w.size() - 1);
  s.problem.observations.push_back({0, lonely, 300, 250, -1, 1});  // one monocular view
  BundleAdjuster adjuster(s.problem);
  scene::run_to_the_end(adjuster);
  for (const auto& T : adjuster.problem().T_cw) EXPECT_TRUE(finite(T));
  for (const auto& p : adjuster.problem().p_w) EXPECT_TRUE(p.allFinite());
  const auto outliers = adjuster.outliers();
  for (std::size_t i = 0; i < outliers.size(); ++i) {
    EXPECT_TRUE(outliers[i] || s.problem.observations[i].point >= 10);
  }
  for (int i = 0; i < 5; ++i) {
    EXPECT_LT(scene::position_error_m(adjuster.problem().T_cw[i], s.true_T_cw[i]), 0.03);
  }
}

}  // namespace
}  // namespace slambed
