// SPDX-License-Identifier: Apache-2.0
#include "features/descriptor_distance.hpp"

#include "base/processor.hpp"

namespace slambed {
namespace {

#define SLAMBED_DISTANCE_LOOPS(prefix, attributes)                                                 \
  attributes void prefix##_to_each(const Descriptor& one, const Descriptor* const* others,         \
                                   std::size_t n, std::uint16_t* out) {                            \
    for (std::size_t i = 0; i < n; ++i)                                                            \
      out[i] = static_cast<std::uint16_t>(hamming(one, *others[i]));                               \
  }                                                                                                \
  attributes void prefix##_to_some(const Descriptor& one, const Descriptor* all, const int* which, \
                                   std::size_t n, std::uint16_t* out) {                            \
    for (std::size_t i = 0; i < n; ++i)                                                            \
      out[i] = static_cast<std::uint16_t>(hamming(one, all[which[i]]));                            \
  }                                                                                                \
  attributes void prefix##_to_all(const Descriptor& one, const Descriptor* all, std::size_t n,     \
                                  std::uint16_t* out) {                                            \
    for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::uint16_t>(hamming(one, all[i])); \
  }                                                                                                \
  constexpr DistanceKernels prefix##_kernels{#prefix, prefix##_to_each, prefix##_to_some,          \
                                             prefix##_to_all};

SLAMBED_DISTANCE_LOOPS(plain, )
#if defined(__x86_64__)
SLAMBED_DISTANCE_LOOPS(popcnt, __attribute__((target("popcnt"))))
#endif

}  // namespace

const DistanceKernels& plain_distance() { return plain_kernels; }

const DistanceKernels* popcnt_distance() {
#if defined(__x86_64__)
  return &popcnt_kernels;
#else
  return nullptr;
#endif
}

const DistanceKernels& descriptor_distance() {
  static const DistanceKernels& fastest = [&]() -> const DistanceKernels& {
    if (vector_set() >= VectorSet::kAvx512 && avx512_distance()) return *avx512_distance();
    if (has_popcnt() && popcnt_distance()) return *popcnt_distance();
    return plain_kernels;
  }();
  return fastest;
}

}  // namespace slambed
