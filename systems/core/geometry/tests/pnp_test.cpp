// SPDX-License-Identifier: Apache-2.0
// Pose from three points, and from many matches with outliers.
#include <gtest/gtest.h>

#include <random>

#include "geometry/p3p.hpp"
#include "geometry/pnp_ransac.hpp"
#include "geometry/tests/test_camera.hpp"

namespace slambed {
namespace {

using testing::test_camera;

struct PnpScene {
  explicit PnpScene(unsigned seed) : random(seed) {
    Eigen::Matrix<double, 6, 1> twist;
    for (int i = 0; i < 6; ++i) twist[i] = uniform(-1, 1);
    T_cw = SE3::exp(twist);
  }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  PnpCorrespondence match(double noise_px = 0) {
    const double u = uniform(0, 640), v = uniform(0, 480);
    std::normal_distribution<double> noise(0, 1);
    const Eigen::Vector3d p_w = T_cw.inverse() * test_camera().unproject(u, v, uniform(0.5, 8));
    return {p_w, u + noise_px * noise(random), v + noise_px * noise(random), 1};
  }
  std::mt19937 random;
  SE3 T_cw;
};

double pose_error(const SE3& a, const SE3& b) { return (a * b.inverse()).log().norm(); }

TEST(P3p, OneSolutionIsTheTruth) {
  int exact = 0;
  constexpr int kScenes = 500;
  for (unsigned seed = 0; seed < kScenes; ++seed) {
    PnpScene scene(seed);
    std::array<Eigen::Vector3d, 3> points, directions;
    for (int i = 0; i < 3; ++i) {
      const auto match = scene.match();
      points[i] = match.p_w;
      directions[i] = test_camera().unproject(match.u, match.v, 1).normalized();
    }
    double best = 1e9;
    for (const SE3& pose : solve_p3p(points, directions)) {
      best = std::min(best, pose_error(pose, scene.T_cw));
    }
    exact += best < 1e-5;
  }
  // Double roots lose digits, and a few random triangles come close to one.
  EXPECT_GE(exact, kScenes * 98 / 100);
}

TEST(P3p, PointsOnALineHaveNoSolution) {
  const std::array<Eigen::Vector3d, 3> line{Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(1, 0, 2),
                                            Eigen::Vector3d(2, 0, 2)};
  const std::array<Eigen::Vector3d, 3> directions{line[0].normalized(), line[1].normalized(),
                                                  line[2].normalized()};
  EXPECT_TRUE(solve_p3p(line, directions).empty());
}

TEST(PnpRansac, FindsThePoseAmongFortyPercentOutliers) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    PnpScene scene(seed);
    std::vector<PnpCorrespondence> matches;
    for (int i = 0; i < 60; ++i) matches.push_back(scene.match(0.5));
    for (int i = 0; i < 40; ++i) {
      auto wrong = scene.match();
      wrong.u = scene.uniform(0, 640), wrong.v = scene.uniform(0, 480);
      matches.push_back(wrong);
    }
    const auto result = solve_pnp_ransac(test_camera(), matches);
    ASSERT_TRUE(result) << "seed " << seed;
    // A P3P pose without refinement: half a pixel of noise is about 1 mrad and 1 cm, and thin
    // triangles amplify it.
    EXPECT_LT(pose_error(result->T_cw, scene.T_cw), 0.15) << "seed " << seed;
    EXPECT_GE(result->inliers, 30) << "seed " << seed;
  }
}

TEST(PnpRansac, PureOutliersGiveNothing) {
  PnpScene scene(3);
  std::vector<PnpCorrespondence> matches;
  for (int i = 0; i < 60; ++i) {
    auto wrong = scene.match();
    wrong.u = scene.uniform(0, 640), wrong.v = scene.uniform(0, 480);
    matches.push_back(wrong);
  }
  EXPECT_FALSE(solve_pnp_ransac(test_camera(), matches, {.min_inliers = 15}));
  EXPECT_FALSE(solve_pnp_ransac(test_camera(), {}));
}

TEST(PnpRansac, EqualSeedsGiveEqualPoses) {
  PnpScene scene(4);
  std::vector<PnpCorrespondence> matches;
  for (int i = 0; i < 80; ++i) matches.push_back(scene.match(1));
  const auto a = solve_pnp_ransac(test_camera(), matches);
  const auto b = solve_pnp_ransac(test_camera(), matches);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->T_cw.R, b->T_cw.R);
  EXPECT_EQ(a->T_cw.t, b->T_cw.t);
}

}  // namespace
}  // namespace slambed
