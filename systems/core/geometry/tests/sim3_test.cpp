// SPDX-License-Identifier: Apache-2.0
// Similarity transforms: exponential map, adjoint and Jacobian against their definitions.
#include "geometry/sim3.hpp"

#include <gtest/gtest.h>

#include <random>

namespace slambed {
namespace {

Vector7 random_tangent(std::mt19937& random, double turn, double scale) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Vector7 x;
  for (int i = 0; i < 7; ++i) x(i) = unit(random) * (i < 3 ? 3 : i < 6 ? turn : scale);
  return x;
}

double difference(const Sim3& a, const Sim3& b) {
  return std::abs(a.scale - b.scale) + (a.R - b.R).norm() + (a.t - b.t).norm();
}

/// Returns exp by definition: the power series of the 4x4 matrix.
Sim3 series_exp(const Vector7& x) {
  Eigen::Matrix4d X = Eigen::Matrix4d::Zero();
  X << x(6), -x(5), x(4), x(0), x(5), x(6), -x(3), x(1), -x(4), x(3), x(6), x(2), 0, 0, 0, 0;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity(), term = sum;
  for (int k = 1; k < 60; ++k) {
    term = term * X / k;
    sum += term;
  }
  const double scale = std::cbrt(sum.topLeftCorner<3, 3>().determinant());
  return {scale, sum.topLeftCorner<3, 3>() / scale, sum.topRightCorner<3, 1>()};
}

TEST(Sim3, ExpIsTheMatrixExponential) {
  std::mt19937 random(1);
  for (const double turn : {0.0, 1e-4, 0.005, 0.0099, 0.0101, 0.5, 1.7})
    for (const double scale : {0.0, 1e-5, 0.009, 0.011, 0.7, 1.5})
      for (int i = 0; i < 5; ++i) {
        const Vector7 x = random_tangent(random, turn, scale);
        EXPECT_LT(difference(sim3_exp(x), series_exp(x)), 1e-9) << turn << " " << scale;
      }
}

TEST(Sim3, LogUndoesExp) {
  std::mt19937 random(2);
  for (const double turn : {0.0, 1e-6, 0.005, 0.5, 1.7})
    for (const double scale : {0.0, 1e-5, 0.5}) {
      const Vector7 x = random_tangent(random, turn, scale);
      EXPECT_LT((sim3_log(sim3_exp(x)) - x).norm(), 1e-9) << turn << " " << scale;
    }
}

TEST(Sim3, WithoutScaleItIsARigidMotion) {
  std::mt19937 random(3);
  Vector7 x = random_tangent(random, 1, 0);
  const Sim3 S = sim3_exp(x);
  const SE3 T = SE3::exp(x.head<6>());
  EXPECT_EQ(S.scale, 1);
  EXPECT_LT((S.R - T.R).norm() + (S.t - T.t).norm(), 1e-12);
  EXPECT_LT((sim3_log(S).head<6>() - T.log()).norm(), 1e-12);
}

TEST(Sim3, AdjointCarriesTangentsAcross) {
  std::mt19937 random(4);
  for (int i = 0; i < 20; ++i) {
    const Sim3 S = sim3_exp(random_tangent(random, 1.5, 0.5));
    const Vector7 x = random_tangent(random, 0.5, 0.3);
    const Sim3 across = S * sim3_exp(x) * S.inverse();
    EXPECT_LT(difference(across, sim3_exp(sim3_adjoint(S) * x)), 1e-9);
  }
}

TEST(Sim3, LeftJacobianInverseIsTheDerivativeOfLog) {
  std::mt19937 random(5);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 20; ++i) {
    const Vector7 x = random_tangent(random, 0.8, 0.3);
    const Matrix7 J = sim3_left_jacobian_inverse(x);
    const Matrix7 J_right = sim3_left_jacobian_inverse(-x);
    for (int k = 0; k < 7; ++k) {
      const Vector7 d = kStep * Vector7::Unit(k);
      const Vector7 left =
          (sim3_log(sim3_exp(d) * sim3_exp(x)) - sim3_log(sim3_exp(-d) * sim3_exp(x))) /
          (2 * kStep);
      EXPECT_LT((left - J.col(k)).norm(), 1e-6) << k;
      const Vector7 right =
          (sim3_log(sim3_exp(x) * sim3_exp(d)) - sim3_log(sim3_exp(x) * sim3_exp(-d))) /
          (2 * kStep);
      EXPECT_LT((right - J_right.col(k)).norm(), 1e-6) << k;
    }
  }
}

TEST(Sim3, ScaledWorldsProjectAlike) {
  // Converting S to a pose keeps the direction of the ray to the point S^-1 p.
  std::mt19937 random(6);
  const Sim3 S = sim3_exp(random_tangent(random, 1, 0.5));
  const Eigen::Vector3d p_c(0.3, -0.2, 2);
  const Eigen::Vector3d seen = to_se3(S) * (S.inverse() * p_c);
  EXPECT_LT((seen.normalized() - p_c.normalized()).norm(), 1e-12);
  EXPECT_NEAR(seen.norm() * S.scale, p_c.norm(), 1e-12);
}

}  // namespace
}  // namespace slambed
