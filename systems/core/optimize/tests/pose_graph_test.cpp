// SPDX-License-Identifier: Apache-2.0
// Closes a ring of relative poses, rigid and with scale drift.
#include "optimize/pose_graph.hpp"

#include <gtest/gtest.h>

#include "optimize/tests/loop_scene.hpp"

namespace slambed {
namespace {

int run(PoseGraph& graph) {
  int steps = 0;
  while (graph.step()) ++steps;
  return steps;
}

double worst(const std::vector<Sim3>& a, const std::vector<Sim3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    most = std::max(most, (a[i].inverse().t - b[i].inverse().t).norm());
  return most;
}

class PoseGraphTest : public ::testing::TestWithParam<double> {};  // scale noise

TEST_P(PoseGraphTest, ExactMeasurementsAreMetExactly) {
  auto scene = scene::make_ring(60, 0, 0);
  scene.problem.fix_scale = GetParam() == 0;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (std::size_t i = 1; i < scene.problem.S_cw.size(); ++i) {
    Vector7 error;
    for (int k = 0; k < 7; ++k) error(k) = (k < 6 ? 0.1 : GetParam()) * normal(random);
    scene.problem.S_cw[i] = sim3_exp(error) * scene.problem.S_cw[i];
  }
  PoseGraph graph(scene.problem);
  EXPECT_LE(run(graph), 20);
  EXPECT_LT(graph.cost(), 1e-16);
  for (std::size_t i = 0; i < scene.truth.size(); ++i)
    EXPECT_LT(scene::sim3_distance(graph.problem().S_cw[i], scene.truth[i]), 1e-7);
}

TEST_P(PoseGraphTest, ALoopTakesAwayMostOfTheDrift) {
  const auto scene = scene::make_ring(200, 0.004, GetParam());
  PoseGraph graph(scene.problem);
  const double before = graph.cost();
  run(graph);
  EXPECT_LT(graph.cost(), 0.1 * before);
  const double drift_m = worst(scene.problem.S_cw, scene.truth);
  EXPECT_GT(drift_m, 0.2);
  EXPECT_LT(worst(graph.problem().S_cw, scene.truth), 0.5 * drift_m);
  EXPECT_LT(scene::sim3_distance(graph.problem().S_cw.back(), scene.truth.back()), 0.02);
  EXPECT_EQ(scene::sim3_distance(graph.problem().S_cw[0], scene.truth[0]), 0) << "fixed";
  if (GetParam() == 0) {
    for (const Sim3& S : graph.problem().S_cw) EXPECT_EQ(S.scale, 1);
  }
}

TEST_P(PoseGraphTest, TheCostNeverRisesAndRunsAreEqualToTheLastBit) {
  const auto scene = scene::make_ring(50, 0.05, GetParam(), 9);
  PoseGraph a(scene.problem), b(scene.problem);
  double cost = a.cost();
  while (a.step()) {
    EXPECT_LE(a.cost(), cost);
    cost = a.cost();
    EXPECT_TRUE(b.step());
  }
  EXPECT_FALSE(b.step());
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    EXPECT_EQ(a.problem().S_cw[i].t, b.problem().S_cw[i].t);
    EXPECT_EQ(a.problem().S_cw[i].R, b.problem().S_cw[i].R);
    EXPECT_NEAR(a.problem().S_cw[i].R.determinant(), 1, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(RigidAndScaled, PoseGraphTest, ::testing::Values(0.0, 0.004));

TEST(PoseGraph, NothingToDoIsDoneAtOnce) {
  PoseGraph empty({});
  EXPECT_FALSE(empty.step());
  PoseGraphProblem lone;
  lone.S_cw = {Sim3(), Sim3()};
  lone.fixed = {1, 0};
  PoseGraph unlinked(lone);
  EXPECT_FALSE(unlinked.step());
  lone.edges.push_back({0, 1, Sim3()});
  PoseGraph arrived(lone);
  EXPECT_LE(run(arrived), 1);
}

TEST(PoseGraph, WithoutAnythingFixedItStaysNearTheStart) {
  auto scene = scene::make_ring(20, 0.01, 0);
  scene.problem.fixed.clear();
  PoseGraph graph(scene.problem);
  const double before = graph.cost();
  run(graph);
  EXPECT_LT(graph.cost(), before);
  EXPECT_LT(worst(graph.problem().S_cw, scene.truth), 1);
}

TEST(PoseGraph, PosesNobodyMeasuredStay) {
  auto scene = scene::make_ring(10, 0.01, 0);
  const Sim3 lone = sim3_exp(Vector7::Constant(0.1));
  scene.problem.S_cw.push_back(lone);
  scene.problem.fixed.push_back(0);
  PoseGraph graph(scene.problem);
  run(graph);
  EXPECT_LT(scene::sim3_distance(graph.problem().S_cw.back(), lone), 1e-12);
}

}  // namespace
}  // namespace slambed
