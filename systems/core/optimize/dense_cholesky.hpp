// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "optimize/aligned_doubles.hpp"
#include "optimize/schur_kernels.hpp"

namespace slambed {

/// A symmetric positive definite matrix (lower triangle) and its Cholesky factorization by the
/// kernels, with the same bytes on every processor. Eigen would use only the baseline instructions
/// of the build, two numbers at a time.
class DenseCholesky {
 public:
  DenseCholesky(std::size_t size, const SchurKernels& kernels);

  void set_zero() { numbers_.fill(0); }
  /// Returns a matrix element. The elements below it in the column are contiguous.
  double* at(std::size_t row, std::size_t column) {
    return numbers_.data() + stride_ * column + row;
  }
  /// Returns false when the matrix is not positive definite.
  bool factorize();
  /// Solves in place after factorize(). Returns false when the result is not finite.
  bool solve(std::span<double> right) const;

 private:
  const SchurKernels& kernels_;
  std::size_t size_, padded_, stride_;
  AlignedDoubles numbers_, scratch_;
};

}  // namespace slambed
