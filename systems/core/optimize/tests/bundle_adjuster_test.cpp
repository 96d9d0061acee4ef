// SPDX-License-Identifier: Apache-2.0
#include "optimize/bundle_adjuster.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "optimize/tests/scene.hpp"

namespace slambed {
namespace {

using scene::make_bundle_scene;

constexpr BundleOptions kThorough{30, 30, 0};

bool same_bits(const BundleProblem& a, const BundleProblem& b) {
  return std::memcmp(a.T_cw.data(), b.T_cw.data(), a.T_cw.size() * sizeof(SE3)) == 0 &&
         std::memcmp(a.p_w.data(), b.p_w.data(), a.p_w.size() * sizeof(Eigen::Vector3d)) == 0;
}

double worst_position_error_m(const scene::BundleScene& s, const BundleProblem& p) {
  double worst = 0;
  for (std::size_t i = 0; i < p.T_cw.size(); ++i) {
    worst = std::max(worst, scene::position_error_m(p.T_cw[i], s.true_T_cw[i]));
  }
  return worst;
}

TEST(BundleAdjusterTest, NoiseFreeSceneIsRecovered) {
  for (const double mono_share : {0.0, 0.5, 1.0}) {
    const auto s =
        make_bundle_scene(6, 4, 300, 5, {.seed = 2, .noise_px = 0, .mono_share = mono_share});
    BundleAdjuster adjuster(s.problem, kThorough);
    scene::run_to_the_end(adjuster);
    const BundleProblem& p = adjuster.problem();
    // Pixels are 32-bit floats, accurate to 3e-5 px. The depth error is z^2 / (f b) times that.
    EXPECT_LT(worst_position_error_m(s, p), 1e-5);
    for (std::size_t i = 0; i < p.p_w.size(); ++i) {
      EXPECT_LT((p.p_w[i] - s.true_p_w[i]).norm(), 1e-4);
    }
    const auto outliers = adjuster.outliers();
    EXPECT_EQ(std::count(outliers.begin(), outliers.end(), 1), 0);
  }
}

TEST(BundleAdjusterTest, ResidualsOfANoisySceneHaveTheExpectedSize) {
  const auto s = make_bundle_scene(10, 5, 1000, 5, {.seed = 3});
  // Starts plain least squares at the truth, so that bad initial values cause no outliers.
  BundleProblem from_truth = s.problem;
  from_truth.T_cw = s.true_T_cw;
  from_truth.p_w = s.true_p_w;
  for (auto& o : from_truth.observations) o.inv_sigma2 *= 0.1f;  // no observation exceeds the limit
  BundleAdjuster plain(from_truth,
                       {.robust_iterations = 0, .final_iterations = 20, .relative_stop = 0});
  scene::run_to_the_end(plain);
  double chi2 = 0;
  int coordinates = 0;
  for (const auto& o : from_truth.observations) {
    chi2 += 10 * scene::chi2(plain.problem(), o);
    coordinates += o.right_u >= 0 ? 3 : 2;
  }
  // chi2 has mean (coordinates - parameters) and standard deviation sqrt(2 (...)): 1.2 % here.
  const double freedom = coordinates - 6.0 * 10 - 3.0 * 1000;
  EXPECT_NEAR(chi2 / freedom, 1, 0.05);
  EXPECT_LT(worst_position_error_m(s, plain.problem()), 0.02);
}

TEST(BundleAdjusterTest, SeparatesOutliers) {
  for (const double share : {0.05, 0.1, 0.2}) {
    const auto s =
        make_bundle_scene(10, 5, 800, 6, {.seed = 4, .outlier_share = share, .mono_share = 0.2});
    BundleAdjuster adjuster(s.problem, BundleOptions{.relative_stop = 0});
    const double start = worst_position_error_m(s, s.problem);
    scene::run_to_the_end(adjuster);
    // Without outliers, five seeds gave 0.010 to 0.015 m at the free end of the trajectory.
    EXPECT_LT(worst_position_error_m(s, adjuster.problem()), 0.03);
    EXPECT_LT(worst_position_error_m(s, adjuster.problem()), start / 2);
    const auto outliers = adjuster.outliers();
    int bad = 0, bad_found = 0, good = 0, good_marked = 0;
    for (std::size_t i = 0; i < outliers.size(); ++i) {
      (s.outlier[i] ? bad : good) += 1;
      (s.outlier[i] ? bad_found : good_marked) += outliers[i];
    }
    // A point with several bad observations of six can hide one. All others must be found.
    EXPECT_GT(bad_found, 0.97 * bad) << share;
    EXPECT_LT(good_marked, (0.05 + share / 2) * good) << share;
  }
}

TEST(BundleAdjusterTest, EveryStepHoldsTheBestValuesSoFar) {
  const auto s =
      make_bundle_scene(8, 4, 400, 5, {.seed = 5, .outlier_share = 0.1, .pose_error = 0.05});
  BundleAdjuster adjuster(s.problem,
                          {.robust_iterations = 12, .final_iterations = 0, .relative_stop = 0});
  double cost = adjuster.robust_cost();
  double from_definition = 0;
  for (const auto& o : s.problem.observations) {
    from_definition += scene::huber_cost(scene::chi2(s.problem, o), scene::limit(o.right_u));
  }
  EXPECT_NEAR(cost, from_definition, 1e-9 * cost);
  int steps = 0;
  const double first = cost;
  while (adjuster.step()) {
    ++steps;
    EXPECT_LE(adjuster.robust_cost(), cost * (1 + 1e-12));
    cost = adjuster.robust_cost();
    EXPECT_EQ(adjuster.outliers().size(), s.problem.observations.size());
  }
  EXPECT_LT(cost, 0.5 * first);
  EXPECT_GT(steps, 3);
  EXPECT_LE(steps, 12);
}

TEST(BundleAdjusterTest, FixedPosesAndFinishedProblemsStay) {
  const auto s = make_bundle_scene(5, 3, 200, 4, {.seed = 6});
  BundleAdjuster adjuster(s.problem);
  const int steps = scene::run_to_the_end(adjuster);
  EXPECT_GE(steps, 2);
  EXPECT_LE(steps, 15);
  const BundleProblem done = adjuster.problem();
  EXPECT_FALSE(adjuster.step());
  EXPECT_TRUE(same_bits(done, adjuster.problem()));
  for (int i = 5; i < 8; ++i) {
    EXPECT_EQ(std::memcmp(&done.T_cw[i], &s.problem.T_cw[i], sizeof(SE3)), 0);
  }
}

TEST(BundleAdjusterTest, EarlyStopSavesStepsAndStaysClose) {
  const auto s = make_bundle_scene(10, 5, 1000, 5, {.seed = 7, .outlier_share = 0.05});
  BundleAdjuster early(s.problem), full(s.problem, BundleOptions{.relative_stop = 0});
  EXPECT_LT(scene::run_to_the_end(early), scene::run_to_the_end(full));
  EXPECT_NEAR(early.robust_cost(), full.robust_cost(), 1e-3 * full.robust_cost());
}

TEST(BundleAdjusterTest, OrderOfTheObservationsDoesNotChangeABit) {
  const auto s =
      make_bundle_scene(6, 3, 200, 4, {.seed = 8, .outlier_share = 0.1, .mono_share = 0.3});
  BundleProblem shuffled = s.problem;
  std::mt19937 random(1);
  std::shuffle(shuffled.observations.begin(), shuffled.observations.end(), random);
  BundleAdjuster a(s.problem), b(shuffled), c(s.problem);
  scene::run_to_the_end(a), scene::run_to_the_end(b), scene::run_to_the_end(c);
  EXPECT_TRUE(same_bits(a.problem(), c.problem()));
  EXPECT_TRUE(same_bits(a.problem(), b.problem()));
  EXPECT_EQ(a.robust_cost(), b.robust_cost());
}

TEST(BundleAdjusterTest, ADoubledObservationCountsTwice) {
  const auto s = make_bundle_scene(5, 3, 100, 4, {.seed = 9, .noise_px = 0.5});
  BundleProblem doubled = s.problem, weighted = s.problem;
  for (std::size_t i = 0; i < 100; ++i) {
    doubled.observations.push_back(s.problem.observations[3 * i]);
    weighted.observations[3 * i].inv_sigma2 *= 2;
  }
  // Plain least squares with all errors below the limits, so that both keep all observations.
  for (auto* problem : {&doubled, &weighted}) {
    problem->T_cw = s.true_T_cw;
    problem->p_w = s.true_p_w;
    for (auto& o : problem->observations) o.inv_sigma2 *= 0.05f;
  }
  const BundleOptions plain{0, 20, 0};
  BundleAdjuster a(doubled, plain), b(weighted, plain);
  scene::run_to_the_end(a), scene::run_to_the_end(b);
  for (int i = 0; i < 5; ++i) {
    EXPECT_LT((a.problem().T_cw[i].t - b.problem().T_cw[i].t).norm(), 1e-8);
  }
}

TEST(BundleAdjusterTest, AWholeMapOfManyPosesIsSolvedAsWell) {
  // 150 free poses use the sparse system.
  const auto exact = make_bundle_scene(150, 2, 1500, 6, {.noise_px = 0, .pose_error = 0.005});
  BundleAdjuster adjuster(exact.problem, {.robust_iterations = 60, .relative_stop = 0});
  scene::run_to_the_end(adjuster);
  for (int i = 0; i < 150; ++i) {
    EXPECT_LT(scene::position_error_m(adjuster.problem().T_cw[i], exact.true_T_cw[i]), 1e-4) << i;
  }
  const auto noisy =
      make_bundle_scene(150, 2, 1500, 6, {.outlier_share = 0.05, .pose_error = 0.005});
  BundleProblem truth = noisy.problem;
  truth.T_cw = noisy.true_T_cw;
  truth.p_w = noisy.true_p_w;
  BundleAdjuster solved(noisy.problem, {.robust_iterations = 60, .final_iterations = 0}),
      at_truth(truth);
  scene::run_to_the_end(solved);
  EXPECT_LT(solved.robust_cost(), at_truth.robust_cost());
}

TEST(BundleAdjusterTest, CanBeMovedAndInterrupted) {
  const auto s = make_bundle_scene(5, 3, 200, 4, {.seed = 10});
  BundleAdjuster adjuster(s.problem);
  ASSERT_TRUE(adjuster.step());
  const double after_one = adjuster.robust_cost();
  BundleAdjuster moved(std::move(adjuster));
  EXPECT_EQ(moved.robust_cost(), after_one);
  EXPECT_TRUE(moved.step());
  EXPECT_LE(moved.robust_cost(), after_one);
}

}  // namespace
}  // namespace slambed
