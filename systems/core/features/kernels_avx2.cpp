// SPDX-License-Identifier: Apache-2.0
#include "features/kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// To the end of the file: gcc gives templates the target in force there.
#pragma GCC target("avx2")

namespace slambed {
namespace {

constexpr int kBytes = 32;
#include "features/vectors.inl"

inline bool any(U8 v) {
  const __m256i bits = reinterpret_cast<__m256i>(v);
  return !_mm256_testz_si256(bits, bits);
}
inline U16 widen(const uint8_t* from) {
  return reinterpret_cast<U16>(
      _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from))));
}
inline void store_narrow(uint8_t* to, U16 v) {
  const __m256i words = reinterpret_cast<__m256i>(v);
  const __m256i packed = _mm256_permute4x64_epi64(_mm256_packus_epi16(words, words), 0x08);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm256_castsi256_si128(packed));
}

#include "features/kernels.inl"

inline __m128i window(const uint8_t* from) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
}

/// Two blocks of eight outputs at a time: a byte shuffle brings each output its input.
void resize_row_shuffled(const uint8_t* in, const ResizeTable& axis, uint8_t* out) {
  if (!axis.fits_window) return resize_row(in, axis, out);
  const __m256i half = _mm256_set1_epi16(128);
  for (int i = 0; i < axis.size; i += 2 * kResizeBlock) {
    const int block = i / kResizeBlock;
    const __m256i bytes = _mm256_set_m128i(window(in + axis.block_first[block + 1]),
                                           window(in + axis.block_first[block]));
    __m256i place = _mm256_loadu_si256(
        reinterpret_cast<const __m256i*>(axis.place + 2 * static_cast<ptrdiff_t>(i)));
    __m256i sum = half;
    for (const uint16_t* weights : axis.weight) {
      const __m256i w = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(weights + i));
      sum = _mm256_add_epi16(sum, _mm256_mullo_epi16(_mm256_shuffle_epi8(bytes, place), w));
      place = _mm256_add_epi8(place, _mm256_set1_epi16(1));
    }
    store_narrow(out + i, reinterpret_cast<U16>(_mm256_srli_epi16(sum, 8)));
  }
}

constexpr Kernels kKernels{"avx2",  blend_rows, resize_row_shuffled, fast_row, peaks_row, blur_row,
                           moments, describe};

}  // namespace

const Kernels* avx2_kernels() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const Kernels* avx2_kernels() { return nullptr; }
}  // namespace slambed

#endif
