// SPDX-License-Identifier: Apache-2.0
#include "base/processor.hpp"
#include "features/kernels.hpp"

namespace slambed {
namespace {

constexpr int kBytes = 16;
#include "features/vectors.inl"

inline bool any(U8 v) {
  const U64 words = reinterpret_cast<U64>(v);
  uint64_t all = 0;
  for (int i = 0; i < kBytes / 8; ++i) all |= words[i];
  return all != 0;
}
inline U8 excess(U8 a, U8 b) { return max(a, b) - b; }
inline uint32_t nonzero(U8 v) {
  // Byte i of each word keeps only bit i. The product adds all bytes into the highest one.
  const U64 marks = reinterpret_cast<U64>(v != U8{}) & 0x8040201008040201u;
  uint32_t bits = 0;
  for (int i = 0; i < kBytes / 8; ++i)
    bits |= static_cast<uint32_t>(marks[i] * 0x0101010101010101u >> 56) << 8 * i;
  return bits;
}
inline U16 widen(const uint8_t* from) { return __builtin_convertvector(load<HalfU8>(from), U16); }
inline S32 nearest(F32 v) {
  // Adding 1.5 * 2^23 leaves the nearest integer in the low bits of a float.
  constexpr float kRound = 12582912.0f;
  constexpr int32_t kRoundBits = 0x4b400000;
  return reinterpret_cast<S32>(v + kRound) - kRoundBits;
}
// Each 32-bit element holds two adjacent 16-bit numbers.
inline S32 upper(S16 v) { return reinterpret_cast<S32>(v) >> 16; }
inline S32 lower(S16 v) { return reinterpret_cast<S32>(reinterpret_cast<U32>(v) << 16) >> 16; }
inline S32 squares(S16 v) { return lower(v) * lower(v) + upper(v) * upper(v); }
inline S32 in_pairs(S16 v) { return lower(v) + upper(v); }
inline int sum(S32 v) {
  int total = 0;
  for (int i = 0; i < kFloats; ++i) total += v[i];
  return total;
}
inline void store_narrow(uint8_t* to, U16 v) { store(to, __builtin_convertvector(v, HalfU8)); }

#include "features/kernels.inl"

constexpr int kDiscColumns = 32;
struct DiscMask {
  alignas(64) uint16_t row[kOrientationRadius + 1][kDiscColumns] = {};
  constexpr DiscMask() {
    for (int y = 0; y <= kOrientationRadius; ++y)
      for (int x = -kDiscHalfWidth[y]; x <= kDiscHalfWidth[y]; ++x)
        row[y][x + kOrientationRadius] = 0xffff;
  }
};
constexpr DiscMask kDiscMask;

Moments moments(const uint8_t* center, ptrdiff_t stride) {
  // Column sums of the disc, unweighted and weighted by y: at most 31 * 255 and 120 * 255, which
  // fit into 16 bits.
  constexpr int kColumns = kDiscColumns, kParts = kColumns / kHalf;
  const uint8_t* left = center - kOrientationRadius;
  alignas(64) int16_t sum[kColumns], turned[kColumns];
  for (int part = 0; part < kParts; ++part) {
    const int x = part * kHalf;
    U16 total = widen(left + x), weighted{};
    for (uint16_t y = 1; y <= kOrientationRadius; ++y) {
      const U16 keep = load<U16>(kDiscMask.row[y] + x);
      const U16 down = widen(left + y * stride + x) & keep;
      const U16 up = widen(left - y * stride + x) & keep;
      total += down + up;
      weighted += (down - up) * y;
    }
    store(sum + x, total & load<U16>(kDiscMask.row[0] + x));
    store(turned + x, weighted);
  }
  Moments m;
  for (int x = 0; x < kColumns; ++x) {
    m.m10 += (x - kOrientationRadius) * sum[x];
    m.m01 += turned[x];
  }
  return m;
}

constexpr Kernels kKernels{"portable", blend_rows, resize_row, fast_row,   peaks_row,
                           blur,       moments,    describe,   slide_patch};

}  // namespace

const Kernels& portable_kernels() { return kKernels; }

const Kernels& fastest_kernels() {
  if (vector_set() >= VectorSet::kAvx2 && avx2_kernels()) return *avx2_kernels();
  return kKernels;
}

}  // namespace slambed
