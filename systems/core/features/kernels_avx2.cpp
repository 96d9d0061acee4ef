// SPDX-License-Identifier: Apache-2.0
#include "features/kernels.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// This must hold to the end of the file, because gcc instantiates templates with its last target.
#pragma GCC target("avx2")

namespace slambed {
namespace {

constexpr int kBytes = 32;
#include "features/vectors.inl"

inline bool any(U8 v) {
  const __m256i bits = reinterpret_cast<__m256i>(v);
  return !_mm256_testz_si256(bits, bits);
}
inline U8 excess(U8 a, U8 b) {
  return reinterpret_cast<U8>(
      _mm256_subs_epu8(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
}
inline uint32_t nonzero(U8 v) {
  return static_cast<uint32_t>(_mm256_movemask_epi8(reinterpret_cast<__m256i>(v != U8{})));
}
inline U16 widen(const uint8_t* from) {
  return reinterpret_cast<U16>(
      _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from))));
}
inline S32 nearest(F32 v) {
  return reinterpret_cast<S32>(_mm256_cvtps_epi32(reinterpret_cast<__m256>(v)));
}
inline S32 squares(S16 v) {
  const __m256i words = reinterpret_cast<__m256i>(v);
  return reinterpret_cast<S32>(_mm256_madd_epi16(words, words));
}
inline S32 in_pairs(S16 v) {
  return reinterpret_cast<S32>(
      _mm256_madd_epi16(reinterpret_cast<__m256i>(v), _mm256_set1_epi16(1)));
}
inline int sum(S32 v) {
  const __m256i all = reinterpret_cast<__m256i>(v);
  __m128i half = _mm_add_epi32(_mm256_castsi256_si128(all), _mm256_extracti128_si256(all, 1));
  half = _mm_add_epi32(half, _mm_shuffle_epi32(half, 0x4e));
  return _mm_cvtsi128_si32(_mm_add_epi32(half, _mm_shuffle_epi32(half, 0xb1)));
}
inline void store_narrow(uint8_t* to, U16 v) {
  const __m256i words = reinterpret_cast<__m256i>(v);
  const __m256i packed = _mm256_permute4x64_epi64(_mm256_packus_epi16(words, words), 0x08);
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm256_castsi256_si128(packed));
}

#include "features/kernels.inl"

inline __m256i bytes(const uint8_t* from) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
}
inline __m256i words(const uint16_t* from) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
}
inline void put(uint8_t* to, __m256i v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), v); }
// The multiply instruction needs one signed operand, so pixels are shifted by -128.
inline __m256i lessened(__m256i pixels) { return _mm256_xor_si256(pixels, _mm256_set1_epi8(-128)); }
/// Multiplies pairs of pixels with pairs of weights (first + 256 * second) and adds each pair.
inline __m256i products(__m256i lessened_pixels, __m256i weights) {
  return _mm256_maddubs_epi16(weights, lessened_pixels);
}
/// Divides sums of such products by the total weight of 256; the result is still shifted by -128.
inline __m256i rounded(__m256i sum) { return _mm256_mulhrs_epi16(sum, _mm256_set1_epi16(128)); }

template <bool kThree>
void blend(const uint8_t* a, const uint8_t* b, const uint8_t* c, __m256i weights_ab,
           __m256i weights_c, int n, uint8_t* out) {
  for (int x = 0; x < n; x += kBytes) {
    const __m256i first = lessened(bytes(a + x)), second = lessened(bytes(b + x));
    __m256i low = products(_mm256_unpacklo_epi8(first, second), weights_ab);
    __m256i high = products(_mm256_unpackhi_epi8(first, second), weights_ab);
    if (kThree) {
      const __m256i third = lessened(bytes(c + x));
      low = _mm256_add_epi16(low, products(_mm256_unpacklo_epi8(third, third), weights_c));
      high = _mm256_add_epi16(high, products(_mm256_unpackhi_epi8(third, third), weights_c));
    }
    put(out + x, lessened(_mm256_packs_epi16(rounded(low), rounded(high))));
  }
}

/// Most rows have only two input rows with a weight, so that case is faster.
void blend_rows_by_pairs(const uint8_t* const rows[3], const uint16_t weights[3], int n,
                         uint8_t* out) {
  for (int i = 0; i < 3; ++i)
    if (weights[i] > 255) return blend_rows(rows, weights, n, out);
  const auto ab = _mm256_set1_epi16(static_cast<int16_t>(weights[0] | weights[1] << 8));
  const auto c = _mm256_set1_epi16(static_cast<int16_t>(weights[2]));
  if (weights[2] == 0)
    blend<false>(rows[0], rows[1], rows[2], ab, c, n, out);
  else
    blend<true>(rows[0], rows[1], rows[2], ab, c, n, out);
}

inline __m128i window(const uint8_t* from) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
}

/// Computes two blocks of eight outputs at a time; byte shuffles gather the inputs of each output.
void resize_row_shuffled(const uint8_t* in, const ResizeTable& axis, uint8_t* out) {
  if (!axis.fits_window) return resize_row(in, axis, out);
  // Local copies, because the compiler must assume that a store to out may alias the table.
  const int size = axis.size;
  const uint16_t* block_first = axis.block_first;
  const uint16_t* pair_weight = axis.pair_weight;
  const uint16_t* third_weight = axis.weight[2];
  const uint8_t* places = axis.place;
  for (int i = 0; i < size; i += 2 * kResizeBlock) {
    const __m256i pixels =
        lessened(_mm256_set_m128i(window(in + block_first[1]), window(in + block_first[0])));
    block_first += 2;
    const __m256i place = bytes(places + 2 * static_cast<ptrdiff_t>(i));
    const __m256i third = _mm256_add_epi8(place, _mm256_set1_epi8(2));
    const __m256i sum =
        _mm256_add_epi16(products(_mm256_shuffle_epi8(pixels, place), words(pair_weight + i)),
                         products(_mm256_shuffle_epi8(pixels, third), words(third_weight + i)));
    const __m256i mean = rounded(sum);
    const __m256i packed = lessened(_mm256_packs_epi16(mean, mean));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + i),
                     _mm256_castsi256_si128(_mm256_permute4x64_epi64(packed, 0x08)));
  }
}

/// Multiplies pairs of adjacent bytes with pairs of weights (in 128ths) and adds each pair.
inline __m256i weigh(__m256i pixels, int first, int second) {
  return _mm256_maddubs_epi16(pixels, _mm256_set1_epi16(static_cast<int16_t>(first | second << 8)));
}
/// (a + b + c + d + 64) / 128.
inline __m256i mean(__m256i a, __m256i b, __m256i c, __m256i d) {
  const __m256i sum = _mm256_add_epi16(_mm256_add_epi16(a, b), _mm256_add_epi16(c, d));
  return _mm256_mulhrs_epi16(sum, _mm256_set1_epi16(256));
}
/// Gaussian over seven of the eight pixels in four pairs: gauss_even over the first seven,
/// gauss_odd over the last seven.
inline __m256i gauss_even(const __m256i pair[4]) {
  return mean(weigh(pair[0], kGauss3, kGauss2), weigh(pair[1], kGauss1, kGauss0),
              weigh(pair[2], kGauss1, kGauss2), weigh(pair[3], kGauss3, 0));
}
inline __m256i gauss_odd(const __m256i pair[4]) {
  return mean(weigh(pair[0], 0, kGauss3), weigh(pair[1], kGauss2, kGauss1),
              weigh(pair[2], kGauss0, kGauss1), weigh(pair[3], kGauss2, kGauss3));
}

/// Computes two rows at a time, because they share their pairs of input rows.
void blur_two_down(const uint8_t* in, ptrdiff_t stride, int n, uint8_t* out, uint8_t* out_below) {
  for (int x = 0; x < n; x += kBytes) {
    const uint8_t* at = in + x - 3 * stride;
    __m256i low[4], high[4];
    for (int i = 0; i < 4; ++i, at += 2 * stride) {
      const __m256i upper = bytes(at), lower = bytes(at + stride);
      low[i] = _mm256_unpacklo_epi8(upper, lower);
      high[i] = _mm256_unpackhi_epi8(upper, lower);
    }
    put(out + x, _mm256_packus_epi16(gauss_even(low), gauss_even(high)));
    put(out_below + x, _mm256_packus_epi16(gauss_odd(low), gauss_odd(high)));
  }
}

void blur_along(const uint8_t* in, int n, uint8_t* out) {
  for (int x = 0; x < n; x += kBytes) {
    const uint8_t* at = in + x - kBlurRadius;
    const __m256i pair[4] = {bytes(at), bytes(at + 2), bytes(at + 4), bytes(at + 6)};
    put(out + x, _mm256_or_si256(gauss_even(pair), _mm256_slli_epi16(gauss_odd(pair), 8)));
  }
}

void blur_by_pairs(const uint8_t* in, ptrdiff_t stride, int n, int rows, uint8_t* scratch,
                   uint8_t* out, ptrdiff_t out_stride) {
  const int wide = n + 2 * kBlurRadius;
  uint8_t* below = scratch + wide + kKernelSlack;
  int y = 0;
  for (; y + 1 < rows; y += 2) {
    blur_two_down(in + y * stride - kBlurRadius, stride, wide, scratch, below);
    blur_along(scratch + kBlurRadius, n, out + y * out_stride);
    blur_along(below + kBlurRadius, n, out + (y + 1) * out_stride);
  }
  blur(in + y * stride, stride, n, rows - y, scratch, out + y * out_stride, out_stride);
}

/// The disc in rows of 32 bytes: a mask of its columns and their offset from the center.
struct DiscBytes {
  alignas(64) uint8_t inside[kOrientationRadius + 1][kBytes] = {};
  alignas(64) int8_t right[kOrientationRadius + 1][kBytes] = {};
  constexpr DiscBytes() {
    for (int y = 0; y <= kOrientationRadius; ++y)
      for (int x = -kDiscHalfWidth[y]; x <= kDiscHalfWidth[y]; ++x) {
        inside[y][x + kOrientationRadius] = 0xff;
        right[y][x + kOrientationRadius] = static_cast<int8_t>(x);
      }
  }
};
constexpr DiscBytes kDisc;

inline __m256i times_right(__m256i pixels, int y) {
  return _mm256_maddubs_epi16(pixels, *reinterpret_cast<const __m256i*>(kDisc.right[y]));
}
inline __m256i row_sum(__m256i pixels, int y) {
  const __m256i inside = *reinterpret_cast<const __m256i*>(kDisc.inside[y]);
  return _mm256_sad_epu8(_mm256_and_si256(pixels, inside), _mm256_setzero_si256());
}

Moments moments_by_rows(const uint8_t* center, ptrdiff_t stride) {
  const uint8_t* left = center - kOrientationRadius;
  const __m256i ones = _mm256_set1_epi16(1);
  __m256i across = _mm256_madd_epi16(times_right(bytes(left), 0), ones);
  // Goes from the outermost row inwards, so that row y is added to `down` y times.
  __m256i running = _mm256_setzero_si256(), down = _mm256_setzero_si256();
  for (int y = kOrientationRadius; y > 0; --y) {
    const __m256i lower = bytes(left + y * stride), upper = bytes(left - y * stride);
    const __m256i both = _mm256_add_epi16(times_right(lower, y), times_right(upper, y));
    across = _mm256_add_epi32(across, _mm256_madd_epi16(both, ones));
    running = _mm256_add_epi64(running, _mm256_sub_epi64(row_sum(lower, y), row_sum(upper, y)));
    down = _mm256_add_epi64(down, running);
  }
  // The upper half of each 64-bit sum is only sign extension.
  const __m256i low_halves = _mm256_and_si256(down, _mm256_set1_epi64x(0xffffffff));
  return {sum(reinterpret_cast<S32>(across)), sum(reinterpret_cast<S32>(low_halves))};
}

constexpr Kernels kKernels{"avx2",     blend_rows_by_pairs, resize_row_shuffled, fast_row,
                           peaks_row,  blur_by_pairs,       moments_by_rows,     describe,
                           slide_patch};

}  // namespace

const Kernels* avx2_kernels() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const Kernels* avx2_kernels() { return nullptr; }
}  // namespace slambed

#endif
