// SPDX-License-Identifier: Apache-2.0
// The similarity between two views from exact, noisy and outlier matches, also with unknown scale.
#include "optimize/sim3_solver.hpp"

#include <gtest/gtest.h>

#include "optimize/tests/loop_scene.hpp"

namespace slambed {
namespace {

struct Case {
  double scale;
  bool fix_scale;
};
class Sim3SolverTest : public ::testing::TestWithParam<Case> {
 protected:
  Sim3Options options() const {
    Sim3Options o;
    o.fix_scale = GetParam().fix_scale;
    return o;
  }
};

TEST_P(Sim3SolverTest, NoiseFreeMatchesGiveTheTruth) {
  const auto s = scene::make_sim3_scene(30, GetParam().scale, 0, 0, 0);
  const auto found = solve_sim3_ransac(scene::camera(), s.matches, options());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->inliers, 30);
  EXPECT_LT(scene::sim3_distance(found->S_12, s.truth), 1e-9);
}

TEST_P(Sim3SolverTest, HalfOutliersAreToldApart) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const auto s = scene::make_sim3_scene(120, GetParam().scale, 0.5, 0.5, 0.005, seed);
    const auto found = solve_sim3_ransac(scene::camera(), s.matches, options());
    ASSERT_TRUE(found) << seed;
    EXPECT_GE(found->inliers, 30) << seed;
    const Sim3Result refined = refine_sim3(scene::camera(), s.matches, found->S_12, options());
    EXPECT_LT(scene::sim3_distance(refined.S_12, s.truth), 0.02) << seed;
    int wrong = 0;
    for (std::size_t i = 0; i < s.matches.size(); ++i) wrong += refined.inlier[i] && s.outlier[i];
    EXPECT_LE(wrong, 1) << seed;
    EXPECT_GE(refined.inliers, 40) << seed;
  }
}

TEST_P(Sim3SolverTest, RefinementReachesTheTruthFromNearby) {
  const auto s = scene::make_sim3_scene(60, GetParam().scale, 0.1, 0, 0);
  Vector7 error;
  error << 0.03, -0.02, 0.02, 0.01, 0.02, -0.01, options().fix_scale ? 0 : 0.03;
  const Sim3Result refined =
      refine_sim3(scene::camera(), s.matches, sim3_exp(error) * s.truth, options());
  EXPECT_LT(scene::sim3_distance(refined.S_12, s.truth), 1e-5);
  for (std::size_t i = 0; i < s.matches.size(); ++i)
    EXPECT_EQ(refined.inlier[i] == 0, s.outlier[i] != 0) << i;
  if (options().fix_scale) {
    EXPECT_EQ(refined.S_12.scale, s.truth.scale);
  }
}

INSTANTIATE_TEST_SUITE_P(Scales, Sim3SolverTest,
                         ::testing::Values(Case{1, true}, Case{1, false}, Case{1.3, false},
                                           Case{0.4, false}));

TEST(Sim3Solver, TooFewOrContradictoryMatchesGiveNothing) {
  auto s = scene::make_sim3_scene(3, 1, 0, 0, 0);
  EXPECT_TRUE(solve_sim3_ransac(scene::camera(), s.matches));
  s.matches.pop_back();
  EXPECT_FALSE(solve_sim3_ransac(scene::camera(), s.matches));
  EXPECT_FALSE(solve_sim3_ransac(scene::camera(), {}));
  const auto wrong = scene::make_sim3_scene(40, 1, 1, 0, 0);
  const auto found = solve_sim3_ransac(scene::camera(), wrong.matches);
  EXPECT_TRUE(!found || found->inliers < 10);
}

TEST(Sim3Solver, EqualSeedsGiveEqualResults) {
  const auto s = scene::make_sim3_scene(80, 1, 0.4, 1, 0.01);
  const auto a = solve_sim3_ransac(scene::camera(), s.matches);
  const auto b = solve_sim3_ransac(scene::camera(), s.matches);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->S_12.t, b->S_12.t);
  EXPECT_EQ(a->inlier, b->inlier);
}

}  // namespace
}  // namespace slambed
