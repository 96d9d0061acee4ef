// SPDX-License-Identifier: Apache-2.0
// Compares minimum and outliers with Ceres, which computes its own derivatives.
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include "optimize/tests/scene.hpp"

namespace slambed {
namespace {

constexpr double kCostTolerance = 1e-5;  ///< relative

struct Reprojection {
  Camera camera;
  double u, v, right_u, root_weight;

  template <typename T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    T p[3];
    ceres::AngleAxisRotatePoint(pose, point, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
    const T predicted_u = camera.fx * p[0] / p[2] + camera.cx;
    residual[0] = root_weight * (predicted_u - u);
    residual[1] = root_weight * (camera.fy * p[1] / p[2] + camera.cy - v);
    residual[2] = right_u < 0 ? T(0) : root_weight * (predicted_u - camera.bf / p[2] - right_u);
    return true;
  }
};

std::array<double, 6> to_array(const SE3& T) {
  const auto twist = T.log();
  return {twist(3), twist(4), twist(5), T.t.x(), T.t.y(), T.t.z()};
}
SE3 from_array(const std::array<double, 6>& a) {
  Eigen::Matrix<double, 6, 1> turn;
  turn << 0, 0, 0, a[0], a[1], a[2];
  return {SE3::exp(turn).R, Eigen::Vector3d(a[3], a[4], a[5])};
}

/// Minimizes the cost of the observations not marked as outliers; updates free poses and points.
void solve_with_ceres(BundleProblem& problem, const std::vector<std::uint8_t>& outlier, bool robust,
                      bool move_points) {
  std::vector<std::array<double, 6>> poses;
  for (const auto& T : problem.T_cw) poses.push_back(to_array(T));
  ceres::Problem ceres_problem;
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (outlier[i]) continue;
    const auto& o = problem.observations[i];
    ceres_problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Reprojection, 3, 6, 3>(
            new Reprojection{problem.camera, o.u, o.v, o.right_u, std::sqrt(double(o.inv_sigma2))}),
        robust ? new ceres::HuberLoss(std::sqrt(scene::limit(o.right_u))) : nullptr,
        poses[o.pose].data(), problem.p_w[o.point].data());
    if (int(o.pose) >= problem.free_poses) {
      ceres_problem.SetParameterBlockConstant(poses[o.pose].data());
    }
    if (!move_points) ceres_problem.SetParameterBlockConstant(problem.p_w[o.point].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = move_points ? ceres::DENSE_SCHUR : ceres::DENSE_QR;
  options.max_num_iterations = 100;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  for (int i = 0; i < problem.free_poses; ++i) problem.T_cw[i] = from_array(poses[i]);
}

struct Judged {
  double robust_cost = 0, inlier_cost = 0;
  std::vector<std::uint8_t> outlier;
};
Judged judge(const BundleProblem& problem) {
  Judged j;
  for (const auto& o : problem.observations) {
    const double chi2 = scene::chi2(problem, o), limit = scene::limit(o.right_u);
    j.robust_cost += scene::huber_cost(chi2, limit);
    j.outlier.push_back(chi2 > limit);
    if (chi2 <= limit) j.inlier_cost += chi2;
  }
  return j;
}

class OracleTest : public testing::TestWithParam<scene::Recipe> {};

TEST_P(OracleTest, PoseRoundsReachTheSameMinima) {
  const auto s = scene::make_pose_scene(200, GetParam());
  BundleProblem start{scene::camera(), {s.start}, 1, {}, {}};
  for (std::uint32_t i = 0; i < s.observations.size(); ++i) {
    const auto& o = s.observations[i];
    start.p_w.push_back(o.p_w);
    start.observations.push_back({0, i, o.u, o.v, o.right_u, o.inv_sigma2});
  }
  const auto expect_same = [&](int rounds, const BundleProblem& oracle) {
    std::vector<std::uint8_t> outlier;
    PoseOptimizer ours({.rounds = rounds, .iterations = 50, .relative_stop = 0});
    const auto got = ours.solve(scene::camera(), s.start, s.observations, outlier);
    const Judged want = judge(oracle);
    EXPECT_EQ(outlier, want.outlier) << rounds;
    EXPECT_NEAR(got.cost, want.inlier_cost, kCostTolerance * want.inlier_cost) << rounds;
    EXPECT_LT(scene::position_error_m(got.T_cw, oracle.T_cw[0]), 1e-5) << rounds;
  };
  // Every round restarts from the given pose without the outliers of the previous round. The last
  // of four uses plain least squares, a single round is robust.
  std::vector<std::uint8_t> outlier(s.observations.size(), 0);
  for (int round = 1; round <= 4; ++round) {
    BundleProblem oracle = start;
    solve_with_ceres(oracle, outlier, round < 4, false);
    if (round == 1 || round == 4) expect_same(round, oracle);
    outlier = judge(oracle).outlier;
  }
}

TEST_P(OracleTest, BundleStagesReachTheSameMinima) {
  const auto s = scene::make_bundle_scene(6, 4, 250, 5, GetParam());
  BundleAdjuster robust_only(s.problem,
                             {.robust_iterations = 60, .final_iterations = 0, .relative_stop = 0});
  while (robust_only.step()) {
  }
  BundleProblem oracle = s.problem;
  solve_with_ceres(oracle, std::vector<std::uint8_t>(oracle.observations.size(), 0), true, true);
  Judged want = judge(oracle);
  EXPECT_NEAR(robust_only.robust_cost(), want.robust_cost, kCostTolerance * want.robust_cost);
  EXPECT_EQ(robust_only.outliers(), want.outlier);

  BundleAdjuster both(s.problem,
                      {.robust_iterations = 60, .final_iterations = 60, .relative_stop = 0});
  while (both.step()) {
  }
  solve_with_ceres(oracle, want.outlier, false, true);
  want = judge(oracle);
  const Judged got = judge(both.problem());
  EXPECT_EQ(both.outliers(), want.outlier);
  EXPECT_NEAR(got.inlier_cost, want.inlier_cost, kCostTolerance * want.inlier_cost);
  EXPECT_NEAR(got.robust_cost, want.robust_cost, kCostTolerance * want.robust_cost);
  for (int i = 0; i < 6; ++i) {
    EXPECT_LT(scene::position_error_m(both.problem().T_cw[i], oracle.T_cw[i]), 1e-4);
  }
}

TEST(WildPointTest, APointWithMostlyOutliersIsNotLost) {
  // One point has gross errors in three of five views. Ceres lets it move behind the cameras, which
  // costs all five views. BundleAdjuster must keep it in front and reach a lower cost.
  const auto s = scene::make_bundle_scene(6, 4, 250, 5, {.seed = 2, .outlier_share = 0.05});
  BundleProblem oracle = s.problem;
  solve_with_ceres(oracle, std::vector<std::uint8_t>(oracle.observations.size(), 0), true, true);
  BundleAdjuster adjuster(s.problem, {60, 0, 0});
  while (adjuster.step()) {
  }
  EXPECT_LE(adjuster.robust_cost(), judge(oracle).robust_cost * (1 + kCostTolerance));
  for (const auto& o : s.problem.observations) {
    const BundleProblem& p = adjuster.problem();
    EXPECT_GT((p.T_cw[o.pose] * p.p_w[o.point]).z(), 0) << o.point;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, OracleTest,
    testing::Values(scene::Recipe{.seed = 1}, scene::Recipe{.seed = 7, .outlier_share = 0.05},
                    scene::Recipe{.seed = 3, .outlier_share = 0.2},
                    scene::Recipe{.seed = 4, .outlier_share = 0.1, .mono_share = 0.5},
                    scene::Recipe{
                        .seed = 5, .noise_px = 0.5, .outlier_share = 0.05, .mono_share = 1},
                    scene::Recipe{.seed = 6, .outlier_share = 0.1, .pose_error = 0.04}),
    [](const auto& scene_info) { return "seed" + std::to_string(scene_info.param.seed); });

}  // namespace
}  // namespace slambed
