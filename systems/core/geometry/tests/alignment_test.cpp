// SPDX-License-Identifier: Apache-2.0
#include "geometry/alignment.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <random>
#include <vector>

#include "geometry/tests/draws.hpp"

namespace slambed {
namespace {

struct Pairs {
  std::vector<Eigen::Vector3d> from, to;
  Sim3 truth;
};

Pairs make_pairs(int count, double scale, double noise_m, unsigned seed, bool planar = false) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return drawn<3>([&] { return normal(random); }); };
  Pairs pairs;
  const Eigen::Vector3d q = vector();
  pairs.truth = {scale,
                 Eigen::Quaterniond(q.x(), q.y(), q.z(), 0.4).normalized().toRotationMatrix(),
                 3 * vector()};
  for (int i = 0; i < count; ++i) {
    Eigen::Vector3d p = vector();
    if (planar) p.z() = 0;
    pairs.from.push_back(p);
    pairs.to.push_back(pairs.truth * p + noise_m * vector());
  }
  return pairs;
}

double squared_error(const Sim3& T, const Pairs& pairs) {
  double sum = 0;
  for (std::size_t i = 0; i < pairs.from.size(); ++i) {
    sum += (pairs.to[i] - T * pairs.from[i]).squaredNorm();
  }
  return sum;
}

TEST(AlignmentTest, RecoversExactTransforms) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    const Pairs rigid = make_pairs(3 + seed % 5, 1, 0, seed, seed % 2 == 0);
    const auto T = align_se3(rigid.from, rigid.to);
    ASSERT_TRUE(T);
    EXPECT_LT((T->R - rigid.truth.R).norm() + (T->t - rigid.truth.t).norm(), 1e-12);
    EXPECT_NEAR(T->R.determinant(), 1, 1e-12);

    const Pairs similar = make_pairs(5, 2.5, 0, seed);
    const auto S = align_sim3(similar.from, similar.to);
    ASSERT_TRUE(S);
    EXPECT_NEAR(S->scale, 2.5, 1e-12);
    EXPECT_LT((S->R - similar.truth.R).norm() + (S->t - similar.truth.t).norm(), 1e-11);
  }
}

TEST(AlignmentTest, NoisyAnswerIsAMinimumOfTheSquaredError) {
  const Pairs pairs = make_pairs(40, 1.7, 0.05, 3);
  const auto best = align_sim3(pairs.from, pairs.to);
  ASSERT_TRUE(best);
  const double cost = squared_error(*best, pairs);
  EXPECT_LT(cost, squared_error(pairs.truth, pairs));
  for (int axis = 0; axis < 7; ++axis) {
    for (const double step : {-1e-3, 1e-3}) {
      Sim3 moved = *best;
      if (axis < 3)
        moved.t(axis) += step;
      else if (axis < 6)
        moved.R = Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(axis - 3)) * moved.R;
      else
        moved.scale += step;
      EXPECT_GT(squared_error(moved, pairs), cost) << axis;
    }
  }
}

TEST(AlignmentTest, MirroredPointsStillGiveARotation) {
  Pairs pairs = make_pairs(20, 1, 0, 5);
  for (auto& p : pairs.to) p.x() = -p.x();
  const auto T = align_se3(pairs.from, pairs.to);
  ASSERT_TRUE(T);
  EXPECT_NEAR(T->R.determinant(), 1, 1e-12);
}

TEST(AlignmentTest, RefusesWhatHasNoUniqueAnswer) {
  const Pairs pairs = make_pairs(4, 1, 0, 9);
  std::vector<Eigen::Vector3d> line, same(4, Eigen::Vector3d(1, 2, 3));
  for (int i = 0; i < 4; ++i) line.push_back(Eigen::Vector3d(1, 2, 3) * i);
  EXPECT_FALSE(align_se3(line, line));
  EXPECT_FALSE(align_se3(same, same));
  EXPECT_FALSE(align_se3(std::span(pairs.from).first(2), std::span(pairs.to).first(2)));
  EXPECT_FALSE(align_se3(std::span(pairs.from).first(3), pairs.to));
  auto bad = pairs.to;
  bad[1].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(align_sim3(pairs.from, bad));
}

TEST(AlignmentTest, SimilarityInverseAndProduct) {
  const Sim3 a = make_pairs(3, 2, 0, 1).truth, b = make_pairs(3, 0.4, 0, 2).truth;
  const Eigen::Vector3d p(1, -2, 0.5);
  EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-13);
  EXPECT_LT((a.inverse() * (a * p) - p).norm(), 1e-13);
}

}  // namespace
}  // namespace slambed
