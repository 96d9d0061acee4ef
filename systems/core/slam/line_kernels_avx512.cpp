// SPDX-License-Identifier: Apache-2.0
#include "slam/line_kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// Applies up to the end of the file, as in features/kernels_avx2.cpp.
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,popcnt")

namespace slambed {
namespace {

constexpr std::size_t kLanes = 16;
static_assert(kLanes <= kLineSlack);
typedef float F32x16 __attribute__((vector_size(64)));

std::size_t near(const LinePoints& points, const ImageLine& line, int* numbers) {
  std::size_t found = 0;
  __m512i number = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const __m512i step = _mm512_set1_epi32(kLanes);
  for (std::size_t first = 0; first < points.count; first += kLanes) {
    const F32x16 u = _mm512_loadu_ps(points.u + first), v = _mm512_loadu_ps(points.v + first);
    const F32x16 d = line.x * u + line.y * v + line.z;
    const F32x16 limit = _mm512_loadu_ps(points.limit + first) * line.norm2;
    const __mmask16 mask = _mm512_cmp_ps_mask(d * d, limit, _CMP_LT_OQ);
    _mm512_storeu_si512(numbers + found, _mm512_maskz_compress_epi32(mask, number));
    found += static_cast<std::size_t>(__builtin_popcount(mask));
    number = _mm512_add_epi32(number, step);
  }
  return found;
}

constexpr LineKernels kKernels{"avx512", near};

}  // namespace

const LineKernels* avx512_line_kernels() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const LineKernels* avx512_line_kernels() { return nullptr; }
}  // namespace slambed

#endif
