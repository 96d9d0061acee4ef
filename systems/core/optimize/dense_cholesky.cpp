// SPDX-License-Identifier: Apache-2.0
#include "optimize/dense_cholesky.hpp"

#include <algorithm>
#include <cmath>

namespace slambed {
namespace {

constexpr std::size_t rounded_up(std::size_t count, std::size_t step) {
  return (count + step - 1) / step * step;
}

}  // namespace

DenseCholesky::DenseCholesky(std::size_t size, const SchurKernels& kernels)
    : kernels_(kernels),
      size_(size),
      padded_(rounded_up(size, kFactorColumns)),
      stride_(rounded_up(size, kColumnStride)) {
  numbers_.resize(stride_ * padded_);
  scratch_.resize(kFactorColumns * padded_);
}

bool DenseCholesky::factorize() {
  for (std::size_t i = size_; i < padded_; ++i) *at(i, i) = 1;
  return kernels_.factorize(numbers_.data(), padded_, stride_, scratch_.data());
}

bool DenseCholesky::solve(std::span<double> right) const {
  const double* column = numbers_.data();
  for (std::size_t k = 0; k < size_; ++k, column += stride_) {
    right[k] /= column[k];
    for (std::size_t i = k + 1; i < size_; ++i) right[i] -= column[i] * right[k];
  }
  for (std::size_t k = size_; k-- > 0;) {
    column -= stride_;
    // Four independent sums hide latency. Their order is the same on every machine.
    double sums[4] = {right[k], 0, 0, 0};
    std::size_t i = k + 1;
    for (; i + 4 <= size_; i += 4)
      for (std::size_t lane = 0; lane < 4; ++lane) sums[lane] -= column[i + lane] * right[i + lane];
    for (; i < size_; ++i) sums[0] -= column[i] * right[i];
    right[k] = (sums[0] + sums[1] + (sums[2] + sums[3])) / column[k];
  }
  return std::all_of(right.begin(), right.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace slambed
