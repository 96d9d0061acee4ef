// SPDX-License-Identifier: Apache-2.0
// Compares the solvers of loop closing with Ceres, which computes its own derivatives.
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include "optimize/tests/loop_scene.hpp"

namespace slambed {
namespace {

using Parameters = std::array<double, 7>;  ///< angle-axis, translation, log scale

Parameters to_parameters(const Sim3& S) {
  const Eigen::Vector3d phi = SE3(S.R, Eigen::Vector3d::Zero()).log().tail<3>();
  return {phi.x(), phi.y(), phi.z(), S.t.x(), S.t.y(), S.t.z(), std::log(S.scale)};
}
Sim3 from_parameters(const Parameters& a) {
  Eigen::Matrix<double, 6, 1> turn;
  turn << 0, 0, 0, a[0], a[1], a[2];
  return {std::exp(a[6]), SE3::exp(turn).R, {a[3], a[4], a[5]}};
}

/// Uses slambed's logarithm with numeric derivatives: both sides share the cost, not the minimizer.
struct GraphResidual {
  Sim3 S_to_from;
  bool operator()(const double* from, const double* to, double* residual) const {
    Parameters f, t;
    std::copy(from, from + 7, f.begin());
    std::copy(to, to + 7, t.begin());
    const Vector7 e = sim3_log(S_to_from * from_parameters(f) * from_parameters(t).inverse());
    std::copy(e.data(), e.data() + 7, residual);
    return true;
  }
};

double graph_cost_by_ceres(const PoseGraphProblem& problem) {
  std::vector<Parameters> poses;
  for (const Sim3& S : problem.S_cw) poses.push_back(to_parameters(S));
  ceres::Problem ceres_problem;
  for (const PoseGraphEdge& edge : problem.edges)
    ceres_problem.AddResidualBlock(
        new ceres::NumericDiffCostFunction<GraphResidual, ceres::CENTRAL, 7, 7, 7>(
            new GraphResidual{edge.S_to_from}),
        nullptr, poses[edge.from].data(), poses[edge.to].data());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (problem.fixed[i])
      ceres_problem.SetParameterBlockConstant(poses[i].data());
    else if (problem.fix_scale)
      ceres_problem.SetManifold(poses[i].data(), new ceres::SubsetManifold(7, {6}));
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 100;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  return 2 * summary.final_cost;
}

TEST(LoopOracle, PoseGraphReachesTheSameMinimum) {
  for (const double scale_noise : {0.0, 0.02}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const auto scene = scene::make_ring(24, 0.03, scale_noise, seed);
      PoseGraph graph(scene.problem, {.iterations = 60, .relative_stop = 0});
      while (graph.step()) {
      }
      const double want = graph_cost_by_ceres(scene.problem);
      EXPECT_NEAR(graph.cost(), want, 1e-5 * want) << scale_noise << " " << seed;
    }
  }
}

struct Sim3Residual {
  Camera camera;
  Sim3Match m;
  bool second;
  template <typename T>
  bool operator()(const T* S, T* residual) const {
    const Eigen::Vector3d& from = second ? m.p_1 : m.p_2;
    T p[3] = {T(from.x()), T(from.y()), T(from.z())}, q[3];
    const T scale = ceres::exp(S[6]);
    if (second) {
      for (int i = 0; i < 3; ++i) p[i] = (p[i] - S[3 + i]) / scale;
      const T back[3] = {-S[0], -S[1], -S[2]};
      ceres::AngleAxisRotatePoint(back, p, q);
    } else {
      ceres::AngleAxisRotatePoint(S, p, q);
      for (int i = 0; i < 3; ++i) q[i] = scale * q[i] + S[3 + i];
    }
    const double root = std::sqrt(second ? m.inv_sigma2_2 : m.inv_sigma2_1);
    residual[0] = root * (camera.fx * q[0] / q[2] + camera.cx - (second ? m.u_2 : m.u_1));
    residual[1] = root * (camera.fy * q[1] / q[2] + camera.cy - (second ? m.v_2 : m.v_1));
    return true;
  }
};

TEST(LoopOracle, Sim3RefinementReachesTheSameMinimum) {
  for (const bool fix_scale : {true, false}) {
    const auto s = scene::make_sim3_scene(80, fix_scale ? 1 : 1.2, 0, 0.4, 0.002, 4);
    Sim3Options ours;
    ours.fix_scale = fix_scale;
    ours.robust_iterations = ours.final_iterations = 60;
    Vector7 error = Vector7::Constant(0.01);
    error(6) = 0;
    const Sim3 start = sim3_exp(error) * s.truth;
    const Sim3Result got = refine_sim3(scene::camera(), s.matches, start, ours);
    ASSERT_EQ(got.inliers, 80) << "the oracle knows no outliers";

    Parameters S = to_parameters(start);
    ceres::Problem problem;
    for (const Sim3Match& m : s.matches)
      for (const bool second : {false, true})
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Sim3Residual, 2, 7>(
                                     new Sim3Residual{scene::camera(), m, second}),
                                 new ceres::HuberLoss(std::sqrt(ours.refine_chi2)), S.data());
    if (fix_scale) problem.SetManifold(S.data(), new ceres::SubsetManifold(7, {6}));
    ceres::Solver::Options options;
    options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    EXPECT_LT(scene::sim3_distance(got.S_12, from_parameters(S)), 1e-6);
  }
}

}  // namespace
}  // namespace slambed
