// SPDX-License-Identifier: Apache-2.0
#include "geometry/se3.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

namespace slambed {
namespace {

using Twist = Eigen::Matrix<double, 6, 1>;

Eigen::Matrix4d generator(const Twist& twist) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  const Eigen::Vector3d phi = twist.tail<3>();
  m.topLeftCorner<3, 3>() << 0, -phi.z(), phi.y(), phi.z(), 0, -phi.x(), -phi.y(), phi.x(), 0;
  m.topRightCorner<3, 1>() = twist.head<3>();
  return m;
}

/// Angles on both sides of every switch of formula, from zero to just below pi.
const double kAngles[] = {
    0, 1e-12, 1e-7, 1e-4, 9.99e-3, 1.001e-2, 0.3, 1.57, 2.5, 3.1, std::numbers::pi - 1e-7};
const Eigen::Vector3d kAxes[] = {{1, 0, 0}, {0, 0, -1}, {0.36, -0.48, 0.8}, {-0.6, 0.8, 0}};

TEST(SE3Test, ExponentialEqualsTheMatrixExponential) {
  for (const double angle : kAngles) {
    for (const auto& axis : kAxes) {
      Twist twist;
      twist << 0.7, -1.3, 2.1, angle * axis;
      const Eigen::Matrix4d want = generator(twist).exp();
      const SE3 got = SE3::exp(twist);
      EXPECT_LT((got.R - want.topLeftCorner<3, 3>()).norm(), 1e-13) << angle;
      EXPECT_LT((got.t - want.topRightCorner<3, 1>()).norm(), 1e-13) << angle;
    }
  }
}

TEST(SE3Test, LogarithmInvertsTheExponential) {
  for (const double angle : kAngles) {
    for (const auto& axis : kAxes) {
      Twist twist;
      twist << 0.7, -1.3, 2.1, angle * axis;
      EXPECT_LT((SE3::exp(twist).log() - twist).norm(), 1e-12) << angle;
    }
  }
}

TEST(SE3Test, HalfTurnHasALogarithmOfLengthPi) {
  for (const auto& axis : kAxes) {
    const SE3 T(Eigen::AngleAxisd(std::numbers::pi, axis.normalized()).toRotationMatrix(),
                Eigen::Vector3d(1, 2, 3));
    const Twist twist = T.log();
    EXPECT_NEAR(twist.tail<3>().norm(), std::numbers::pi, 1e-12);
    const SE3 back = SE3::exp(twist);
    EXPECT_LT((back.R - T.R).norm() + (back.t - T.t).norm(), 1e-12);
  }
}

TEST(SE3Test, InverseAndProductAgreeWithTheMapping) {
  const SE3 a = SE3::exp((Twist() << 1, 2, 3, 0.1, -0.7, 0.4).finished());
  const SE3 b = SE3::exp((Twist() << -2, 0.5, 1, 1.1, 0.2, -0.3).finished());
  const Eigen::Vector3d p(0.3, -4, 2);
  EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-14);
  EXPECT_LT((a.inverse() * (a * p) - p).norm(), 1e-14);
}

TEST(SE3Test, NormalizingRepairsALongChain) {
  SE3 chain;
  const SE3 step = SE3::exp((Twist() << 0.01, 0, 0, 0.02, -0.01, 0.03).finished());
  for (int i = 0; i < 1000; ++i) chain = step * chain;
  chain.R *= 1 + 1e-6;  // exaggerated drift
  const SE3 repaired = chain.normalized();
  EXPECT_LT((repaired.R * repaired.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_LT((repaired.R - chain.R).norm(), 1e-5);
}

}  // namespace
}  // namespace slambed
