// SPDX-License-Identifier: Apache-2.0
#include "slam/line_kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// Applies up to the end of the file, as in features/kernels_avx2.cpp.
#pragma GCC target("avx2")

namespace slambed {
namespace {

constexpr std::size_t kLanes = 8;
typedef float F32x8 __attribute__((vector_size(32)));

std::size_t near(const LinePoints& points, const ImageLine& line, int* numbers) {
  std::size_t found = 0;
  for (std::size_t first = 0; first < points.count; first += kLanes) {
    const F32x8 u = _mm256_loadu_ps(points.u + first), v = _mm256_loadu_ps(points.v + first);
    const F32x8 d = line.x * u + line.y * v + line.z;
    const F32x8 limit = _mm256_loadu_ps(points.limit + first) * line.norm2;
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(d * d, limit, _CMP_LT_OQ)));
    for (; mask != 0; mask &= mask - 1)
      numbers[found++] = static_cast<int>(first) + __builtin_ctz(mask);
  }
  return found;
}

constexpr LineKernels kKernels{"avx2", near};

}  // namespace

const LineKernels* avx2_line_kernels() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const LineKernels* avx2_line_kernels() { return nullptr; }
}  // namespace slambed

#endif
