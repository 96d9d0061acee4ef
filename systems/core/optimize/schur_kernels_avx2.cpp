// SPDX-License-Identifier: Apache-2.0
#include "optimize/schur_kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// This must hold to the end of the file, as in features/kernels_avx2.cpp.
#pragma GCC target("avx2")

namespace slambed {
namespace {

constexpr int kLanes = 4;
typedef double V __attribute__((vector_size(8 * kLanes)));

inline V root(V v) { return _mm256_sqrt_pd(v); }

inline void transpose(__m256d r[4]) {
  const __m256d a = _mm256_unpacklo_pd(r[0], r[1]), b = _mm256_unpackhi_pd(r[0], r[1]);
  const __m256d c = _mm256_unpacklo_pd(r[2], r[3]), d = _mm256_unpackhi_pd(r[2], r[3]);
  r[0] = _mm256_permute2f128_pd(a, c, 0x20);
  r[1] = _mm256_permute2f128_pd(b, d, 0x20);
  r[2] = _mm256_permute2f128_pd(a, c, 0x31);
  r[3] = _mm256_permute2f128_pd(b, d, 0x31);
}
inline void load_transposed(const double* const from[kLanes], V to[4]) {
  __m256d r[4];
  for (int i = 0; i < 4; ++i) r[i] = _mm256_loadu_pd(from[i]);
  transpose(r);
  for (int i = 0; i < 4; ++i) to[i] = r[i];
}
inline void store_transposed(const V* from, double* to, std::ptrdiff_t stride) {
  for (int part = 0; part < kColumnStride; part += 4) {
    __m256d r[4];
    for (int i = 0; i < 4; ++i) r[i] = from[part + i];
    transpose(r);
    for (int i = 0; i < 4; ++i) _mm256_storeu_pd(to + i * stride + part, r[i]);
  }
}

#include "optimize/schur_kernels.inl"

constexpr SchurKernels kKernels = named("avx2");

}  // namespace

const SchurKernels* avx2_schur_kernels() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const SchurKernels* avx2_schur_kernels() { return nullptr; }
}  // namespace slambed

#endif
