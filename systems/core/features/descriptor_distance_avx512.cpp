// SPDX-License-Identifier: Apache-2.0
#include "features/descriptor_distance.hpp"

#if defined(__x86_64__)
#include <immintrin.h>

// This must hold to the end of the file, as in features/kernels_avx2.cpp.
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,avx512vpopcntdq")

namespace slambed {
namespace {

constexpr std::size_t kBlock = 8;  ///< distances per iteration
typedef std::uint64_t U64x8 __attribute__((vector_size(64)));
typedef std::uint64_t U64x4 __attribute__((vector_size(32)));
typedef std::uint64_t U64x2 __attribute__((vector_size(16)));

inline U64x4 load(const Descriptor* from) {
  U64x4 v;
  __builtin_memcpy(&v, from, sizeof v);
  return v;
}
inline U64x8 beside(U64x4 a, U64x4 b) {
  return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}

/// A vector holds two descriptors, i and i + 4. The bit counts of their words go into the i-th 16
/// bits of each word. Adding the four words of each half gives eight distances in order.
inline U64x2 distances(U64x8 one, const Descriptor* const at[kBlock]) {
  U64x8 sum{};
  for (int i = 0; i < 4; ++i) {
    const U64x8 differing = one ^ beside(load(at[i]), load(at[i + 4]));
    sum += (U64x8)_mm512_popcnt_epi64((__m512i)differing) << (16 * i);
  }
  sum += __builtin_shufflevector(sum, sum, 2, 3, 0, 1, 6, 7, 4, 5);
  sum += __builtin_shufflevector(sum, sum, 1, 0, 3, 2, 5, 4, 7, 6);
  return __builtin_shufflevector(sum, sum, 0, 4);
}

/// at(i) returns the i-th of n descriptors.
template <typename At>
inline void loop(const Descriptor& one, std::size_t n, std::uint16_t* out, const At& at) {
  const U64x4 words = load(&one);
  const U64x8 twice = beside(words, words);
  for (std::size_t first = 0; first < n; first += kBlock) {
    const std::size_t here = n - first < kBlock ? n - first : kBlock;
    const Descriptor* block[kBlock];
    for (std::size_t i = 0; i < kBlock; ++i) block[i] = at(first + (i < here ? i : here - 1));
    const U64x2 found = distances(twice, block);
    _mm_mask_storeu_epi16(out + first, static_cast<__mmask8>(0xff >> (kBlock - here)),
                          (__m128i)found);
  }
}

void to_each(const Descriptor& one, const Descriptor* const* others, std::size_t n,
             std::uint16_t* out) {
  loop(one, n, out, [&](std::size_t i) { return others[i]; });
}
void to_some(const Descriptor& one, const Descriptor* all, const int* which, std::size_t n,
             std::uint16_t* out) {
  loop(one, n, out, [&](std::size_t i) { return all + which[i]; });
}
void to_all(const Descriptor& one, const Descriptor* all, std::size_t n, std::uint16_t* out) {
  loop(one, n, out, [&](std::size_t i) { return all + i; });
}

constexpr DistanceKernels kKernels{"avx512", to_each, to_some, to_all};

}  // namespace

const DistanceKernels* avx512_distance() { return &kKernels; }

}  // namespace slambed

#else

namespace slambed {
const DistanceKernels* avx512_distance() { return nullptr; }
}  // namespace slambed

#endif
