// SPDX-License-Identifier: Apache-2.0
// Two views of an unknown scene: exact, noisy, with outliers, planar, with little parallax.
#include "geometry/two_view.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

#include "geometry/tests/draws.hpp"
#include "geometry/tests/test_camera.hpp"

namespace slambed {
namespace {

using testing::test_camera;

/// Points in front of two cameras and their pixels in both.
struct Scene {
  Scene(unsigned seed, const SE3& motion) : random(seed), T_21(motion) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  /// Adds matches of points whose depth is a function of the pixel.
  template <typename Depth>
  void add(int count, double noise_px, Depth depth) {
    std::normal_distribution<double> noise(0, noise_px > 0 ? noise_px : 1);
    const Camera camera = test_camera();
    while (count > 0) {
      const double u = uniform(0, 640), v = uniform(0, 480);
      const Eigen::Vector3d p = camera.unproject(u, v, depth(u, v));
      const Eigen::Vector3d p_2 = T_21 * p;
      if (p_2.z() < 0.1) continue;
      PixelPair pair{{u, v}, camera.project(p_2)};
      if (noise_px > 0) {
        pair.first += drawn<2>([&] { return noise(random); });
        pair.second += drawn<2>([&] { return noise(random); });
      }
      pairs.push_back(pair);
      truth.push_back(p);
      --count;
    }
  }
  void add_deep(int count, double noise_px = 0) {
    add(count, noise_px, [this](double, double) { return uniform(2, 10); });
  }
  /// Adds points of a wall seen at an angle.
  void add_flat(int count, double noise_px = 0) {
    add(count, noise_px,
        [](double u, double v) { return 4 / (1 + 0.0001 * (u - 320) - 0.0005 * (v - 240)); });
  }
  void add_nonsense(int count) {
    for (int i = 0; i < count; ++i) {
      pairs.push_back({{uniform(0, 640), uniform(0, 480)}, {uniform(0, 640), uniform(0, 480)}});
      truth.emplace_back(0, 0, -1);
    }
  }

  std::mt19937 random;
  SE3 T_21;
  std::vector<PixelPair> pairs;
  std::vector<Eigen::Vector3d> truth;  ///< in the first camera's frame; z < 0 marks nonsense
};

SE3 sideways(double meters = 0.5) {
  Eigen::Matrix<double, 6, 1> twist;
  twist << -meters, 0.1 * meters, 0.2 * meters, 0.03, -0.06, 0.02;
  return SE3::exp(twist);
}

/// Moves along a wall, so that only one motion keeps the whole wall in front of the camera.
SE3 along() {
  Eigen::Matrix<double, 6, 1> twist;
  twist << -0.5, 0.05, 0, 0.02, 0.01, 0.02;
  return SE3::exp(twist);
}

double turn_error_deg(const TwoViewResult& found, const Scene& scene) {
  const SE3 between(found.T_21.R * scene.T_21.R.transpose(), Eigen::Vector3d::Zero());
  return between.log().tail<3>().norm() * 180 / std::numbers::pi;
}
double direction_error_deg(const TwoViewResult& found, const Scene& scene) {
  const double cosine = found.T_21.t.normalized().dot(scene.T_21.t.normalized());
  return std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi;
}
/// Returns the largest error of a kept point relative to its distance, scaled by the true baseline.
double worst_point(const TwoViewResult& found, const Scene& scene) {
  double worst = 0;
  for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
    if (!found.good[i] || scene.truth[i].z() < 0) continue;
    const Eigen::Vector3d p = found.p_1[i] * scene.T_21.t.norm();
    worst = std::max(worst, (p - scene.truth[i]).norm() / scene.truth[i].norm());
  }
  return worst;
}

TEST(TwoView, ADeepSceneIsExactWithoutNoise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Scene scene(seed, sideways());
    scene.add_deep(200);
    const auto found = reconstruct_two_views(test_camera(), scene.pairs);
    ASSERT_TRUE(found) << seed;
    EXPECT_EQ(found.model, TwoViewModel::kFundamental);
    EXPECT_LT(found.homography_share, 0.40);
    EXPECT_LT(turn_error_deg(found, scene), 1e-4);
    EXPECT_LT(direction_error_deg(found, scene), 1e-3);
    EXPECT_LT(worst_point(found, scene), 1e-4);
    EXPECT_EQ(found.points, 200);
  }
}

TEST(TwoView, AFlatSceneIsExactWithoutNoise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Scene scene(seed, along());
    scene.add_flat(400);
    const auto found = reconstruct_two_views(test_camera(), scene.pairs);
    ASSERT_TRUE(found) << seed;
    EXPECT_EQ(found.model, TwoViewModel::kHomography);
    EXPECT_GT(found.homography_share, 0.40);
    EXPECT_LT(turn_error_deg(found, scene), 1e-4);
    EXPECT_LT(direction_error_deg(found, scene), 1e-3);
    EXPECT_LT(worst_point(found, scene), 1e-4);
  }
}

TEST(TwoView, TwoMotionsThatExplainAWallEquallyWellAreNoResult) {
  // When moving towards a tilted wall, a second motion along another wall also explains all points.
  Eigen::Matrix<double, 6, 1> twist;
  twist << -0.1, 0, -0.6, 0, 0.02, 0;
  Scene scene(7, SE3::exp(twist));
  scene.add(200, 0, [](double u, double) { return 4 / (1 + 0.0008 * (u - 320)); });
  const auto found = reconstruct_two_views(test_camera(), scene.pairs);
  EXPECT_EQ(found.model, TwoViewModel::kHomography);
  EXPECT_EQ(found.outcome, TwoViewOutcome::kAmbiguous);
}

TEST(TwoView, NoiseOfAPixelCostsADegreeOrTwo) {
  int found_deep = 0, found_flat = 0;
  constexpr int kScenes = 20;
  for (unsigned seed = 1; seed <= kScenes; ++seed) {
    Scene deep(seed, sideways()), flat(seed, along());
    deep.add_deep(300, 0.7);
    flat.add_flat(300, 0.7);
    const auto a = reconstruct_two_views(test_camera(), deep.pairs);
    const auto b = reconstruct_two_views(test_camera(), flat.pairs);
    if (a) {
      ++found_deep;
      EXPECT_EQ(a.model, TwoViewModel::kFundamental);
      EXPECT_LT(turn_error_deg(a, deep), 0.6) << seed;
      EXPECT_LT(direction_error_deg(a, deep), 3) << seed;
    }
    if (b) {
      ++found_flat;
      EXPECT_EQ(b.model, TwoViewModel::kHomography);
      EXPECT_LT(turn_error_deg(b, flat), 0.6) << seed;
      EXPECT_LT(direction_error_deg(b, flat), 5) << seed;
    }
  }
  EXPECT_GE(found_deep, kScenes * 9 / 10);
  EXPECT_GE(found_flat, kScenes * 6 / 10);
}

TEST(TwoView, AThirdOfNonsenseIsLeftOut) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Scene scene(seed, sideways());
    scene.add_deep(200, 0.3);
    scene.add_nonsense(100);
    const auto found = reconstruct_two_views(test_camera(), scene.pairs);
    ASSERT_TRUE(found) << seed;
    EXPECT_LT(turn_error_deg(found, scene), 0.5);
    EXPECT_LT(direction_error_deg(found, scene), 3);
    int kept_nonsense = 0;
    for (std::size_t i = 200; i < 300; ++i) kept_nonsense += found.good[i];
    EXPECT_LE(kept_nonsense, 8) << seed;  // some lie on their epipolar line by chance
  }
}

TEST(TwoView, WithoutMotionThereIsNoResult) {
  Eigen::Matrix<double, 6, 1> turn;
  turn << 0, 0, 0, 0.02, -0.05, 0.01;
  Scene turning(1, SE3::exp(turn)), hardly(2, sideways(0.01)), still(3, SE3());
  turning.add_deep(300, 0.3);
  hardly.add_deep(300, 0.3);
  still.add_deep(300);
  EXPECT_FALSE(reconstruct_two_views(test_camera(), turning.pairs));
  EXPECT_FALSE(reconstruct_two_views(test_camera(), hardly.pairs));
  EXPECT_FALSE(reconstruct_two_views(test_camera(), still.pairs));
}

TEST(TwoView, LittleParallaxIsNamedAsSuch) {
  // Exact matches with a baseline of a fiftieth of the least depth.
  Scene scene(4, sideways(0.04));
  scene.add_deep(300);
  EXPECT_EQ(reconstruct_two_views(test_camera(), scene.pairs).outcome,
            TwoViewOutcome::kLowParallax);
}

TEST(TwoView, BadInputIsNoResult) {
  EXPECT_EQ(reconstruct_two_views(test_camera(), {}).outcome, TwoViewOutcome::kTooFewPairs);
  Scene scene(5, sideways());
  scene.add_nonsense(300);
  EXPECT_FALSE(reconstruct_two_views(test_camera(), scene.pairs));
  const std::vector<PixelPair> same(100, PixelPair{{10, 10}, {12, 10}});
  EXPECT_FALSE(reconstruct_two_views(test_camera(), same));
  std::vector<PixelPair> broken(100, PixelPair{{NAN, 10}, {12, INFINITY}});
  EXPECT_FALSE(reconstruct_two_views(test_camera(), broken));
}

TEST(TwoView, EqualInputGivesEqualBytes) {
  Scene scene(6, sideways());
  scene.add_deep(200, 0.5);
  scene.add_nonsense(50);
  const auto a = reconstruct_two_views(test_camera(), scene.pairs);
  const auto b = reconstruct_two_views(test_camera(), scene.pairs);
  EXPECT_EQ(a.T_21.R, b.T_21.R);
  EXPECT_EQ(a.good, b.good);
}

TEST(TwoViewModels, AHomographyHasTheTrueMotionAmongItsFour) {
  const SE3 T_21 = sideways();
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.1, 1).normalized();
  const Eigen::Matrix3d H = 2.5 * (T_21.R + T_21.t * normal.transpose() / 4);
  double best = 10;
  const auto motions = homography_motions(H);
  EXPECT_EQ(motions.size(), 4u);
  for (const SE3& motion : motions)
    best = std::min(best, (motion.R - T_21.R).norm() + (motion.t - T_21.t.normalized()).norm());
  EXPECT_LT(best, 1e-9);
  EXPECT_TRUE(homography_motions(T_21.R).empty());
}

TEST(TwoViewModels, AnEssentialMatrixHasTheTrueMotionAmongItsFour) {
  const SE3 T_21 = sideways();
  Eigen::Matrix3d cross;
  cross << 0, -T_21.t.z(), T_21.t.y(), T_21.t.z(), 0, -T_21.t.x(), -T_21.t.y(), T_21.t.x(), 0;
  double best = 10;
  for (const SE3& motion : essential_motions(-3 * cross * T_21.R))
    best = std::min(best, (motion.R - T_21.R).norm() + (motion.t - T_21.t.normalized()).norm());
  EXPECT_LT(best, 1e-9);
}

}  // namespace
}  // namespace slambed
