// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "optimize/aligned_doubles.hpp"
#include "optimize/schur_kernels.hpp"

namespace slambed {

/// A symmetric positive definite matrix, its lower triangle, and its factorization by the kernels:
/// the same bytes on every processor. Eigen would use what the compiler may assume of it, which in
/// a program for all of them are two numbers at a time.
class DenseCholesky {
 public:
  DenseCholesky(std::size_t size, const SchurKernels& kernels);

  void set_zero() { numbers_.fill(0); }
  /// Numbers from this one downwards lie side by side.
  double* at(std::size_t row, std::size_t column) {
    return numbers_.data() + stride_ * column + row;
  }
  /// False when the matrix is not positive definite.
  bool factorize();
  /// In place, after factorize(). False when the result is not finite.
  bool solve(std::span<double> right) const;

 private:
  const SchurKernels& kernels_;
  std::size_t size_, padded_, stride_;
  AlignedDoubles numbers_, scratch_;
};

}  // namespace slambed
