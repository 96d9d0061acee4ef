// SPDX-License-Identifier: Apache-2.0
#include "base/processor.hpp"

// Clang cannot compile glibc's header as C++, so GLIBC_TUNABLES has no effect in its builds.
#if defined(__x86_64__) && !defined(__clang__)
#if __has_include(<sys/platform/x86.h>)
#include <sys/platform/x86.h>
#define SLAMBED_CAN(glibc_name, gcc_name) CPU_FEATURE_ACTIVE(glibc_name)
#endif
#endif
#if defined(__x86_64__) && !defined(SLAMBED_CAN)
#define SLAMBED_CAN(glibc_name, gcc_name) __builtin_cpu_supports(gcc_name)
#endif

namespace slambed {

#if defined(__x86_64__)

bool has_popcnt() {
  static const bool can = SLAMBED_CAN(POPCNT, "popcnt");
  return can;
}

VectorSet vector_set() {
  static const VectorSet largest = [] {
    if (!SLAMBED_CAN(AVX2, "avx2") || !has_popcnt()) return VectorSet::kPortable;
    const bool wide = SLAMBED_CAN(AVX512F, "avx512f") && SLAMBED_CAN(AVX512BW, "avx512bw") &&
                      SLAMBED_CAN(AVX512DQ, "avx512dq") && SLAMBED_CAN(AVX512VL, "avx512vl") &&
                      SLAMBED_CAN(AVX512_VPOPCNTDQ, "avx512vpopcntdq");
    return wide ? VectorSet::kAvx512 : VectorSet::kAvx2;
  }();
  return largest;
}

#else

bool has_popcnt() { return false; }
VectorSet vector_set() { return VectorSet::kPortable; }

#endif

}  // namespace slambed
