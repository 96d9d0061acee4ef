// SPDX-License-Identifier: Apache-2.0
#include "base/processor.hpp"
#include "slam/line_kernels.hpp"

namespace slambed {
namespace {

constexpr std::size_t kBlock = 16;  ///< points per iteration, so that the compiler can vectorize
static_assert(kBlock <= kLineSlack);

std::size_t near(const LinePoints& points, const ImageLine& line, int* numbers) {
  std::size_t found = 0;
  for (std::size_t first = 0; first < points.count; first += kBlock) {
    bool within[kBlock];
    bool any = false;
    for (std::size_t i = 0; i < kBlock; ++i) {
      const std::size_t k = first + i;
      const float d = line.x * points.u[k] + line.y * points.v[k] + line.z;
      within[i] = d * d < points.limit[k] * line.norm2;
      any |= within[i];
    }
    if (!any) continue;
    for (std::size_t i = 0; i < kBlock; ++i)
      if (within[i]) numbers[found++] = static_cast<int>(first + i);
  }
  return found;
}

constexpr LineKernels kKernels{"portable", near};

}  // namespace

const LineKernels& portable_line_kernels() { return kKernels; }

const LineKernels& fastest_line_kernels() {
  const VectorSet set = vector_set();
  if (set >= VectorSet::kAvx512 && avx512_line_kernels()) return *avx512_line_kernels();
  if (set >= VectorSet::kAvx2 && avx2_line_kernels()) return *avx2_line_kernels();
  return kKernels;
}

}  // namespace slambed
