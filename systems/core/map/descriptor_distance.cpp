// SPDX-License-Identifier: Apache-2.0
#include "map/descriptor_distance.hpp"

namespace slambed {
namespace {

#define SLAMBED_DISTANCE_LOOPS(prefix, attributes)                                                \
  attributes void prefix##_to_each(                                                               \
      const Descriptor& one, std::span<const Descriptor* const> others, std::uint16_t* out) {     \
    for (const Descriptor* other : others)                                                        \
      *out++ = static_cast<std::uint16_t>(hamming(one, *other));                                  \
  }                                                                                               \
  attributes void prefix##_to_some(const Descriptor& one, const Descriptor* all,                  \
                                   std::span<const int> which, std::uint16_t* out) {              \
    for (const int i : which) *out++ = static_cast<std::uint16_t>(hamming(one, all[i]));          \
  }                                                                                               \
  attributes void prefix##_to_all(const Descriptor& one, std::span<const Descriptor> all,         \
                                  std::uint16_t* out) {                                           \
    for (const Descriptor& other : all) *out++ = static_cast<std::uint16_t>(hamming(one, other)); \
  }                                                                                               \
  constexpr DescriptorDistance prefix##_distance{prefix##_to_each, prefix##_to_some,              \
                                                 prefix##_to_all};

SLAMBED_DISTANCE_LOOPS(plain, )
#if defined(__x86_64__)
SLAMBED_DISTANCE_LOOPS(popcnt, __attribute__((target("popcnt"))))
#endif

}  // namespace

const DescriptorDistance& descriptor_distance() {
#if defined(__x86_64__)
  static const bool has_popcnt = __builtin_cpu_supports("popcnt");
  if (has_popcnt) return popcnt_distance;
#endif
  return plain_distance;
}

}  // namespace slambed
