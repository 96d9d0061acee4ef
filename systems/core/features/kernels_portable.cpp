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
inline U16 widen(const uint8_t* from) { return __builtin_convertvector(load<HalfU8>(from), U16); }
inline void store_narrow(uint8_t* to, U16 v) { store(to, __builtin_convertvector(v, HalfU8)); }

#include "features/kernels.inl"

constexpr Kernels kKernels{"portable", blend_rows, resize_row, fast_row,
                           peaks_row,  blur_row,   moments,    describe};

}  // namespace

const Kernels& portable_kernels() { return kKernels; }

const Kernels& fastest_kernels() {
  if (vector_set() >= VectorSet::kAvx2 && avx2_kernels()) return *avx2_kernels();
  return kKernels;
}

}  // namespace slambed
