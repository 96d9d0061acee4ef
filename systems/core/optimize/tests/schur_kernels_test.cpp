// SPDX-License-Identifier: Apache-2.0
// The kernels of every instruction set give the same bits as the portable ones.
#include "optimize/schur_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstring>
#include <random>

#include "base/processor.hpp"
#include "optimize/bundle_cost.hpp"
#include "optimize/dense_cholesky.hpp"
#include "optimize/elimination_order.hpp"

namespace slambed {
namespace {

std::vector<const SchurKernels*> runnable() {
  std::vector<const SchurKernels*> all{&portable_schur_kernels()};
  if (vector_set() >= VectorSet::kAvx2) all.push_back(avx2_schur_kernels());
  if (vector_set() >= VectorSet::kAvx512) all.push_back(avx512_schur_kernels());
  return all;
}

/// Points in front of and behind cameras, monocular, doubled, inactive and wrong rows.
struct Scene {
  explicit Scene(unsigned seed, std::uint32_t points = 60) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1, 1);
    std::normal_distribution<double> noise(0, 2);
    for (std::uint32_t i = 0; i < kPoses; ++i) {
      Eigen::Matrix<double, 6, 1> twist;
      for (double& value : twist) value = 0.3 * unit(random);
      T_cw.push_back(SE3::exp(twist));
    }
    rows.begin.push_back(0);
    for (std::uint32_t point = 0; point < points; ++point) {
      const double depth = point % 9 == 0 ? 0.2 * unit(random) : 3 + unit(random);
      p_w.push_back({2 * unit(random), unit(random), depth});
      for (std::uint32_t pose = 0; pose < kPoses; ++pose) {
        for (unsigned times = random() % 20 == 0 ? 2 : random() % 2; times > 0; --times) {
          const Eigen::Vector3d p_c = T_cw[pose] * p_w.back();
          const double u = camera.fx * p_c.x() / p_c.z() + camera.cx;
          const bool mono = random() % 4 == 0, off = random() % 10 == 0;
          rows.u.push_back(u + noise(random) + (off ? 50 : 0));
          rows.v.push_back(camera.fy * p_c.y() / p_c.z() + camera.cy + noise(random));
          rows.right_u.push_back(mono ? 0 : u - camera.bf / p_c.z() + noise(random));
          rows.weight.push_back(1 / (1 + unit(random) * unit(random)));
          rows.right_weight.push_back(mono ? 0 : rows.weight.back());
          rows.chi2_limit.push_back(mono ? 5.991 : 7.815);
          rows.pose.push_back(pose);
          rows.point.push_back(point);
          rows.original.push_back(static_cast<std::uint32_t>(rows.original.size()));
          rows.active.push_back(random() % 12 != 0);
        }
      }
      rows.begin.push_back(static_cast<std::uint32_t>(rows.size()));
    }
    for (auto* list :
         {&rows.u, &rows.v, &rows.right_u, &rows.weight, &rows.right_weight, &rows.chi2_limit})
      list->resize(rows.size() + kRowSlack);
    for (auto* list : {&rows.pose, &rows.point}) list->resize(rows.size() + kRowSlack);
    rows.free_poses = kFree;
    values.look_at(T_cw, p_w);
  }

  static constexpr std::uint32_t kPoses = 9, kFree = 6;
  Pinhole camera{Camera{640, 480, 525, 525, 319.5, 239.5, 40, {}}};
  std::vector<SE3> T_cw;
  std::vector<Eigen::Vector3d> p_w;
  BundleRows rows;
  BundleValues values{rows, camera};
};

/// Everything that kernels compute, without padding.
struct Result {
  std::vector<double> numbers;
  std::vector<std::uint8_t> flags;

  void take(const double* from, std::size_t count) {
    numbers.insert(numbers.end(), from, from + count);
  }
  bool same_bits(const Result& other) const {
    return flags == other.flags && numbers.size() == other.numbers.size() &&
           std::memcmp(numbers.data(), other.numbers.data(), 8 * numbers.size()) == 0;
  }
};

Result costs_by(const SchurKernels& kernels, const Scene& scene, bool robust) {
  const std::size_t n = scene.rows.size();
  Result result;
  result.numbers.resize(n + kRowSlack);
  result.flags.resize(n + kRowSlack);
  kernels.row_costs(scene.values.view(robust), n, result.numbers.data(), result.flags.data());
  result.numbers.resize(n);
  result.flags.resize(n);
  return result;
}

/// The normal equations of a scene and the result of eliminating the points from a zero matrix.
struct Equations {
  Equations(const SchurKernels& kernels, const Scene& scene, bool robust)
      : order(scene.rows, nullptr), points(scene.p_w.size()) {
    pose_sums.resize(kPoseSumsSize * Scene::kFree);
    point_sums.resize(kPointSumsSize * points);
    cross.resize(kCrossSize * order.slots());
    inverse.resize(kPointSumsSize * points);
    right.resize(kColumnStride * Scene::kFree);
    blocks.resize(kPoseBlockSize * order.blocks());
    coupled.resize(order.slots());
    invertible.resize(points);
    for (std::size_t i = 0; i < points; ++i) {
      constexpr double kInverse[9] = {0.3, 0.01, -0.02, 0.4, 0.03, 0.2, 0.5, -0.25, 1.0 / 3};
      std::copy_n(kInverse, 9, inverse.data() + kPointSumsSize * i);
      invertible[i] = i % 11 != 5;
    }
    kernels.linearize(scene.values.view(robust), scene.rows.size(),
                      {scene.rows.active.data(), order.slot.data(), Scene::kFree, pose_sums.data(),
                       point_sums.data(), cross.data(), coupled.data()});
    AlignedDoubles scratch;
    scratch.resize(kCrossSize * order.most_rows);
    std::vector<std::uint8_t> taking_part(order.most_rows);
    for (std::size_t p = 0; p < Scene::kFree; ++p) {
      const std::size_t first = order.slot_begin[p], block = order.block_begin[p];
      kernels.eliminate({first, order.slot_begin[p + 1] - first, cross.data(), coupled.data(),
                         order.point.data(), inverse.data(), invertible.data(),
                         right.data() + kColumnStride * p, scratch.data(), taking_part.data(),
                         blocks.data() + kPoseBlockSize * block, order.block_begin[p + 1] - block,
                         order.pair_begin.data() + block, order.pairs.data()});
    }
  }

  /// Returns all of it without padding.
  Result result() const {
    Result result;
    result.flags = coupled;
    for (std::size_t p = 0; p < Scene::kFree; ++p)
      result.take(pose_sums.data() + kPoseSumsSize * p, 27);
    for (std::size_t i = 0; i < points; ++i) result.take(point_sums.data() + kPointSumsSize * i, 9);
    for (std::size_t p = 0; p < Scene::kFree; ++p) result.take(right.data() + kColumnStride * p, 6);
    for (std::size_t c = 0; c < 6 * order.blocks(); ++c)
      result.take(blocks.data() + kColumnStride * c, 6);
    return result;
  }

  EliminationOrder order;
  std::size_t points;
  AlignedDoubles pose_sums, point_sums, cross, inverse, right, blocks;
  std::vector<std::uint8_t> coupled, invertible;
};

TEST(SchurKernels, EveryInstructionSetGivesTheSameBits) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Scene scene(seed, 40 + seed);  // row counts that are no multiple of the lanes
    for (const bool robust : {true, false}) {
      const Result costs = costs_by(portable_schur_kernels(), scene, robust);
      const Result equations = Equations(portable_schur_kernels(), scene, robust).result();
      EXPECT_TRUE(std::count(costs.flags.begin(), costs.flags.end(), 1) > 0);
      for (const SchurKernels* kernels : runnable()) {
        EXPECT_TRUE(costs_by(*kernels, scene, robust).same_bits(costs)) << kernels->name;
        EXPECT_TRUE(Equations(*kernels, scene, robust).result().same_bits(equations))
            << kernels->name;
      }
    }
  }
}

/// Returns the lower triangle of a symmetric positive definite matrix.
DenseCholesky matrix_of(const Eigen::MatrixXd& full, const SchurKernels& kernels) {
  const auto n = static_cast<std::size_t>(full.rows());
  DenseCholesky matrix(n, kernels);
  for (std::size_t c = 0; c < n; ++c)
    for (std::size_t r = c; r < n; ++r) *matrix.at(r, c) = full(r, c);
  return matrix;
}

TEST(SchurKernels, FactorizationSolvesAsEigensAndGivesTheSameBits) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const int n : {1, 6, 8, 18, 31, 120}) {
    const Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(n, n, [&] { return unit(random); });
    const Eigen::MatrixXd full = root * root.transpose() + Eigen::MatrixXd::Identity(n, n);
    const Eigen::VectorXd right = Eigen::VectorXd::NullaryExpr(n, [&] { return unit(random); });
    const Eigen::VectorXd expected = full.llt().solve(right);
    Eigen::VectorXd portable;
    for (const SchurKernels* kernels : runnable()) {
      DenseCholesky matrix = matrix_of(full, *kernels);
      Eigen::VectorXd solution = right;
      ASSERT_TRUE(matrix.factorize());
      ASSERT_TRUE(matrix.solve({solution.data(), static_cast<std::size_t>(n)}));
      EXPECT_LT((solution - expected).norm(), 1e-10 * expected.norm()) << n;
      if (portable.size() == 0) portable = solution;
      EXPECT_EQ(std::memcmp(solution.data(), portable.data(), 8 * static_cast<std::size_t>(n)), 0)
          << kernels->name << ", " << n;
    }
    Eigen::MatrixXd indefinite = full;
    indefinite(n - 1, n - 1) = -1;
    for (const SchurKernels* kernels : runnable())
      EXPECT_FALSE(matrix_of(indefinite, *kernels).factorize()) << kernels->name;
  }
}

/// Recomputes every sum, one pair of rows at a time, from the blocks of linearize().
TEST(SchurKernels, EliminationTakesEveryPairOfRowsOfAPointOnce) {
  const Scene scene(5);
  const BundleRows& rows = scene.rows;
  const EliminationOrder order(rows, nullptr);
  const Equations found(portable_schur_kernels(), scene, true);
  using Block = Eigen::Matrix<double, 6, 6>;
  std::vector<Block> expected(order.blocks(), Block::Zero());
  for (std::size_t i = 0; i < scene.p_w.size(); ++i) {
    if (!found.invertible[i]) continue;
    const double* v = found.inverse.data() + kPointSumsSize * i;
    Eigen::Matrix3d inverse;
    inverse << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
    const auto W = [&](std::size_t row) {
      return Eigen::Map<const Eigen::Matrix<double, 6, 3>, 0, Eigen::OuterStride<kColumnStride>>(
          found.cross.data() + kCrossSize * order.slot[row]);
    };
    for (std::size_t k = rows.begin[i]; k < rows.begin[i + 1]; ++k) {
      for (std::size_t l = rows.begin[i]; l < rows.begin[i + 1]; ++l) {
        if (rows.pose[k] >= Scene::kFree || rows.pose[l] >= Scene::kFree) continue;
        if (!found.coupled[order.slot[k]] || !found.coupled[order.slot[l]]) continue;
        if (rows.pose[l] < rows.pose[k]) continue;  // the upper triangle
        expected[order.block_begin[rows.pose[k]] + rows.pose[l] - rows.pose[k]] -=
            W(l) * inverse * W(k).transpose();
      }
    }
  }
  for (std::size_t b = 0; b < order.blocks(); ++b) {
    const Eigen::Map<const Block, 0, Eigen::OuterStride<kColumnStride>> block(found.blocks.data() +
                                                                              kPoseBlockSize * b);
    EXPECT_LT((block - expected[b]).norm(), 1e-9 * (1 + expected[b].norm())) << b;
  }
}

TEST(SchurKernels, CostsOfRowsAreThoseOfTheReprojectionError) {
  const Scene scene(3);
  const BundleRows& rows = scene.rows;
  for (const bool robust : {true, false}) {
    const Result costs = costs_by(portable_schur_kernels(), scene, robust);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Eigen::Vector3d p = scene.T_cw[rows.pose[k]] * scene.p_w[rows.point[k]];
      EXPECT_EQ(costs.flags[k], !(p.z() > kMinDepth_m));
      if (costs.flags[k]) continue;
      const double chi2 =
          ReprojectionError(scene.camera, rows.measurement(k), p.x(), p.y(), p.z()).chi2;
      const double expected = robust ? huber(chi2, rows.chi2_limit[k]).rho : chi2;
      EXPECT_NEAR(costs.numbers[k], expected, 1e-9 * (1 + expected));
    }
  }
}

}  // namespace
}  // namespace slambed
