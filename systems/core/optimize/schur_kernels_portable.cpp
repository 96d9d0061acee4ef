// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "base/processor.hpp"
#include "optimize/schur_kernels.hpp"

namespace slambed {
namespace {

constexpr int kLanes = 2;
typedef double V __attribute__((vector_size(8 * kLanes)));

inline V root(V v) { return V{std::sqrt(v[0]), std::sqrt(v[1])}; }
inline void load_transposed(const double* const from[kLanes], V to[4]) {
  for (int i = 0; i < 4; ++i) to[i] = V{from[0][i], from[1][i]};
}
inline void store_transposed(const V* from, double* to, std::ptrdiff_t stride) {
  for (int i = 0; i < kColumnStride; ++i) {
    to[i] = from[i][0];
    to[stride + i] = from[i][1];
  }
}

#include "optimize/schur_kernels.inl"

constexpr SchurKernels kKernels = named("portable");

}  // namespace

const SchurKernels& portable_schur_kernels() { return kKernels; }

const SchurKernels& fastest_schur_kernels() {
  const VectorSet set = vector_set();
  if (set >= VectorSet::kAvx512 && avx512_schur_kernels()) return *avx512_schur_kernels();
  if (set >= VectorSet::kAvx2 && avx2_schur_kernels()) return *avx2_schur_kernels();
  return kKernels;
}

}  // namespace slambed
