// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

namespace slambed {

/// A sparse symmetric positive definite matrix of D x D blocks (lower triangle) and its
/// factorization. The pattern is fixed, so the elimination order (approximate minimum degree) is
/// computed only once. Stride: numbers per column of a block; rows beyond D are padding.
template <int D, int Stride = D>
class SparseBlocks {
 public:
  using Block = Eigen::Matrix<double, Stride, D>;

  /// pairs: (row, column) with row >= column, in any order, duplicates allowed. Diagonal blocks are
  /// always added.
  SparseBlocks(std::size_t size, std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs)
      : size_(size), begin_(size + 1, 0) {
    for (std::uint32_t i = 0; i < size; ++i) pairs.emplace_back(i, i);
    std::sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
      return std::tie(a.second, a.first) < std::tie(b.second, b.first);
    });
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    rows_.reserve(pairs.size());
    for (const auto& [row, column] : pairs) {
      rows_.push_back(row);
      ++begin_[column + 1];
    }
    for (std::size_t i = 0; i < size; ++i) begin_[i + 1] += begin_[i];
    blocks_.resize(rows_.size());
  }

  std::size_t size() const { return size_; }
  std::size_t count() const { return blocks_.size(); }
  /// Index of the block at (row, column), which must be in the pattern; row >= column.
  std::size_t find(std::uint32_t row, std::uint32_t column) const {
    const auto first = rows_.begin() + begin_[column], last = rows_.begin() + begin_[column + 1];
    return static_cast<std::size_t>(std::lower_bound(first, last, row) - rows_.begin());
  }
  /// Index after the last block of the column. Its first block is the diagonal one.
  std::size_t column_end(std::size_t column) const { return begin_[column + 1]; }
  Block& operator[](std::size_t number) { return blocks_[number]; }
  /// All blocks, contiguous.
  double* data() { return blocks_.front().data(); }
  Block& at(std::uint32_t row, std::uint32_t column) { return blocks_[find(row, column)]; }
  void set_zero() {
    for (Block& block : blocks_) block.setZero();
  }

  /// Solves in place. Returns false for a matrix that is not positive definite or no finite result.
  bool solve(Eigen::VectorXd& right) {
    fill();
    if (!analyzed_) factor_.analyzePattern(matrix_);
    analyzed_ = true;
    factor_.factorize(matrix_);
    if (factor_.info() != Eigen::Success) return false;
    right = factor_.solve(right).eval();
    return right.allFinite();
  }

 private:
  /// Copies the lower triangle by columns. The first call also builds the pattern.
  void fill() {
    const bool first = matrix_.size() == 0;
    if (first) {
      const auto n = static_cast<Eigen::Index>(D * size_);
      matrix_.resize(n, n);
      matrix_.reserve(static_cast<Eigen::Index>(D * D * blocks_.size()));
    }
    double* value = matrix_.valuePtr();
    for (std::size_t column = 0; column < size_; ++column) {
      for (int c = 0; c < D; ++c) {
        if (first) matrix_.startVec(static_cast<Eigen::Index>(D * column + c));
        for (std::size_t k = begin_[column]; k < begin_[column + 1]; ++k) {
          for (int r = rows_[k] == column ? c : 0; r < D; ++r) {
            if (first)
              matrix_.insertBack(D * static_cast<Eigen::Index>(rows_[k]) + r,
                                 static_cast<Eigen::Index>(D * column + c)) = blocks_[k](r, c);
            else
              *value++ = blocks_[k](r, c);
          }
        }
      }
    }
    if (first) matrix_.finalize();
  }

  std::size_t size_;
  std::vector<std::uint32_t> rows_;  ///< of each block, by columns
  std::vector<std::size_t> begin_;   ///< first block of each column
  std::vector<Block> blocks_;
  Eigen::SparseMatrix<double> matrix_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor_;
  bool analyzed_ = false;
};

}  // namespace slambed
