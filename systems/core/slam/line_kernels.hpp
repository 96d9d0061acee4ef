// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace slambed {

/// Arrays of points and results must have this many accessible elements beyond the last.
inline constexpr std::size_t kLineSlack = 16;

/// Image points that may lie near lines.
struct LinePoints {
  const float *u, *v;  ///< px
  const float* limit;  ///< of the squared distance, px^2; negative (as in the slack): never found
  std::size_t count;
};

/// The line x * u + y * v + z = 0; norm2 = x^2 + y^2 > 0.
struct ImageLine {
  float x, y, z, norm2;
};

/// Finds the points near a line. All implementations return the same. Their files must not use
/// inline functions from other headers (see features/kernels.hpp).
struct LineKernels {
  const char* name;
  /// Writes the indices of the points within their limits, ascending; returns their number.
  std::size_t (*near)(const LinePoints& points, const ImageLine& line, int* numbers);
};

const LineKernels& portable_line_kernels();
/// Null in builds for other processors.
const LineKernels* avx2_line_kernels();
const LineKernels* avx512_line_kernels();
/// The fastest that this processor can run.
const LineKernels& fastest_line_kernels();

}  // namespace slambed
