// SPDX-License-Identifier: Apache-2.0
// Compares homography and fundamental matrix with OpenCV's on the same pairs.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "geometry/tests/draws.hpp"
#include "geometry/two_view_models.hpp"

namespace slambed {
namespace {

struct Pairs {
  std::vector<PixelPair> ours;
  std::vector<cv::Point2d> first, second;
};

/// Makes pairs from a camera (f = 500 px) that moves sideways and rotates slightly.
Pairs make_pairs(unsigned seed, bool flat, double noise_px) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(0, 640), v(0, 480), depth(2, 10);
  std::normal_distribution<double> noise(0, noise_px > 0 ? noise_px : 1);
  Eigen::Matrix<double, 6, 1> twist;
  twist << -0.5, 0.1, 0.1, 0.02, -0.05, 0.03;
  const SE3 T_21 = SE3::exp(twist);
  Pairs pairs;
  while (pairs.ours.size() < 150) {
    const double y = v(random), x = u(random);
    const Eigen::Vector2d a(x, y);
    const double z = flat ? 4 / (1 + 0.0005 * a.x()) : depth(random);
    const Eigen::Vector3d p =
        T_21 * Eigen::Vector3d((a.x() - 320) / 500 * z, (a.y() - 240) / 500 * z, z);
    PixelPair pair{a, {500 * p.x() / p.z() + 320, 500 * p.y() / p.z() + 240}};
    if (noise_px > 0) {
      pair.first += drawn<2>([&] { return noise(random); });
      pair.second += drawn<2>([&] { return noise(random); });
    }
    pairs.ours.push_back(pair);
    pairs.first.emplace_back(pair.first.x(), pair.first.y());
    pairs.second.emplace_back(pair.second.x(), pair.second.y());
  }
  return pairs;
}

Eigen::Matrix3d to_eigen(const cv::Mat& m) {
  Eigen::Matrix3d out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out(r, c) = m.at<double>(r, c);
  return out;
}

double rms(const std::vector<PixelPair>& pairs, auto error) {
  double sum = 0;
  for (const PixelPair& pair : pairs) sum += error(pair).first + error(pair).second;
  return std::sqrt(sum / (2 * static_cast<double>(pairs.size())));
}
double homography_rms(const Eigen::Matrix3d& H, const std::vector<PixelPair>& pairs) {
  const Eigen::Matrix3d inverse = H.inverse();
  return rms(pairs, [&](const PixelPair& pair) { return homography_error(H, inverse, pair); });
}
double fundamental_rms(const Eigen::Matrix3d& F, const std::vector<PixelPair>& pairs) {
  return rms(pairs, [&](const PixelPair& pair) { return fundamental_error(F, pair); });
}

TEST(TwoViewOracle, TheSameHomographyAsOpenCv) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Pairs exact = make_pairs(seed, true, 0);
    const auto ours = fit_homography(exact.ours);
    const Eigen::Matrix3d theirs = to_eigen(cv::findHomography(exact.first, exact.second, 0));
    ASSERT_TRUE(ours);
    const Eigen::Matrix3d scaled = *ours / (*ours)(2, 2);
    EXPECT_LT((scaled - theirs).norm(), 1e-6 * theirs.norm()) << seed;
    EXPECT_LT(homography_rms(*ours, exact.ours), 1e-6);
    // With noise, OpenCV also minimizes the reprojection error; the linear fit must come close.
    const Pairs noisy = make_pairs(seed, true, 0.5);
    const auto linear = fit_homography(noisy.ours);
    const Eigen::Matrix3d refined = to_eigen(cv::findHomography(noisy.first, noisy.second, 0));
    ASSERT_TRUE(linear);
    EXPECT_LT(homography_rms(*linear, noisy.ours), 1.02 * homography_rms(refined, noisy.ours));
  }
}

TEST(TwoViewOracle, TheSameFundamentalMatrixAsOpenCv) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Pairs exact = make_pairs(seed, false, 0);
    const auto ours = fit_fundamental(exact.ours);
    const Eigen::Matrix3d theirs =
        to_eigen(cv::findFundamentalMat(exact.first, exact.second, cv::FM_8POINT));
    ASSERT_TRUE(ours);
    Eigen::Matrix3d a = *ours / ours->norm(), b = theirs / theirs.norm();
    if ((a - b).norm() > 1) a = -a;
    EXPECT_LT((a - b).norm(), 1e-6) << seed;
    EXPECT_LT(fundamental_rms(*ours, exact.ours), 1e-6);
    EXPECT_LT(std::abs(a.determinant()), 1e-12);
    const Pairs noisy = make_pairs(seed, false, 0.5);
    const auto linear = fit_fundamental(noisy.ours);
    const Eigen::Matrix3d cv_linear =
        to_eigen(cv::findFundamentalMat(noisy.first, noisy.second, cv::FM_8POINT));
    ASSERT_TRUE(linear);
    const double ours_rms = fundamental_rms(*linear, noisy.ours);
    EXPECT_NEAR(ours_rms / fundamental_rms(cv_linear, noisy.ours), 1, 0.05) << seed;
  }
}

}  // namespace
}  // namespace slambed
