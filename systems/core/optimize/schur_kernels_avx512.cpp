// SPDX-License-Identifier: Apache-2.0
#include "optimize/schur_kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// This must hold to the end of the file, as in features/kernels_avx2.cpp.
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,prefer-vector-width=512")

namespace slambed {
namespace {

constexpr int kLanes = 8;
typedef double V __attribute__((vector_size(8 * kLanes)));

// Masked, because gcc 12 warns of its own header for the plain intrinsic (PR 105593).
inline V root(V v) { return _mm512_maskz_sqrt_pd(0xff, v); }

/// Transposes lanes 0-3 and lanes 4-7 as two separate 4 x 4 blocks.
inline void transpose_halves(V r[4]) {
  const V a = __builtin_shufflevector(r[0], r[1], 0, 8, 2, 10, 4, 12, 6, 14);
  const V b = __builtin_shufflevector(r[0], r[1], 1, 9, 3, 11, 5, 13, 7, 15);
  const V c = __builtin_shufflevector(r[2], r[3], 0, 8, 2, 10, 4, 12, 6, 14);
  const V d = __builtin_shufflevector(r[2], r[3], 1, 9, 3, 11, 5, 13, 7, 15);
  r[0] = __builtin_shufflevector(a, c, 0, 1, 8, 9, 4, 5, 12, 13);
  r[1] = __builtin_shufflevector(b, d, 0, 1, 8, 9, 4, 5, 12, 13);
  r[2] = __builtin_shufflevector(a, c, 2, 3, 10, 11, 6, 7, 14, 15);
  r[3] = __builtin_shufflevector(b, d, 2, 3, 10, 11, 6, 7, 14, 15);
}
inline void load_transposed(const double* const from[kLanes], V to[4]) {
  for (int i = 0; i < 4; ++i)
    to[i] = __builtin_shufflevector(_mm256_loadu_pd(from[i]), _mm256_loadu_pd(from[i + 4]), 0, 1, 2,
                                    3, 4, 5, 6, 7);
  transpose_halves(to);
}
inline void store_transposed(const V* from, double* to, std::ptrdiff_t stride) {
  V low[4], high[4];  // numbers 0-3 and 4-7 of lanes i and i + 4
  for (int i = 0; i < 4; ++i) low[i] = from[i], high[i] = from[4 + i];
  transpose_halves(low);
  transpose_halves(high);
  for (int i = 0; i < 4; ++i) {
    _mm512_storeu_pd(to + i * stride,
                     __builtin_shufflevector(low[i], high[i], 0, 1, 2, 3, 8, 9, 10, 11));
    _mm512_storeu_pd(to + (i + 4) * stride,
                     __builtin_shufflevector(low[i], high[i], 4, 5, 6, 7, 12, 13, 14, 15));
  }
}

#include "optimize/schur_kernels.inl"

constexpr SchurKernels kKernels = named("avx512");

}  // namespace

const SchurKernels* avx512_schur_kernels() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const SchurKernels* avx512_schur_kernels() { return nullptr; }
}  // namespace slambed

#endif
