// SPDX-License-Identifier: Apache-2.0
// Compares sparse block systems with the dense factorization.
#include "optimize/sparse_blocks.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

namespace slambed {
namespace {

template <int D>
struct Example {
  explicit Example(unsigned seed) : random(seed) {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    for (std::uint32_t row = 1; row < kSize; ++row) {
      pairs.emplace_back(row, row - 1);
      pairs.emplace_back(row, random() % row);
      pairs.emplace_back(row, row - 1);  // repeated
    }
    blocks = std::make_unique<SparseBlocks<D>>(kSize, pairs);
    used = pairs;
    fill();
  }
  /// Sets random off-diagonal blocks and a dominant diagonal.
  void fill() {
    std::uniform_real_distribution<double> unit(-1, 1);
    dense = Eigen::MatrixXd::Zero(D * kSize, D * kSize);
    blocks->set_zero();
    for (const auto& [row, column] : used) {
      typename SparseBlocks<D>::Block block;
      for (double& value : block.reshaped()) value = unit(random);
      blocks->at(row, column) = block;
      dense.template block<D, D>(D * row, D * column) = block;
    }
    for (std::uint32_t i = 0; i < kSize; ++i) {
      blocks->at(i, i) += 40.0 * SparseBlocks<D>::Block::Identity();
      dense.template block<D, D>(D * i, D * i) = blocks->at(i, i);
    }
  }
  void expect_solved() {
    Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(D * kSize, -1, 2), solution = right;
    ASSERT_TRUE(blocks->solve(solution));
    const Eigen::MatrixXd full = dense.template selfadjointView<Eigen::Lower>();
    EXPECT_LT((full * solution - right).norm(), 1e-10);
  }

  static constexpr std::uint32_t kSize = 30;
  std::mt19937 random;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> used;
  std::unique_ptr<SparseBlocks<D>> blocks;
  Eigen::MatrixXd dense;
};

TEST(SparseBlocks, SolvesLikeADenseMatrixAgainAndAgain) {
  Example<6> six(1);
  Example<7> seven(2);
  for (int i = 0; i < 3; ++i) {
    six.expect_solved();
    seven.expect_solved();
    six.fill();
    seven.fill();
  }
}

TEST(SparseBlocks, RefusesAnIndefiniteMatrix) {
  Example<6> example(3);
  example.blocks->at(4, 4) = -SparseBlocks<6>::Block::Identity();
  Eigen::VectorXd right = Eigen::VectorXd::Ones(6 * Example<6>::kSize);
  EXPECT_FALSE(example.blocks->solve(right));
}

}  // namespace
}  // namespace slambed
