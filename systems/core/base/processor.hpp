// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace slambed {

/// Vector instruction sets that kernels are written for. Each set contains the previous ones.
enum class VectorSet {
  kPortable,  ///< 16-byte vectors: SSE2, NEON, or plain loops
  kAvx2,      ///< 32 bytes
  kAvx512,    ///< 64 bytes: F, BW, DQ, VL and VPOPCNTDQ (Ice Lake, Zen 4 and later)
};

/// Returns the largest set that the processor and operating system support. With gcc and glibc,
/// GLIBC_TUNABLES=glibc.cpu.hwcaps can disable sets, so that one machine can check that all of them
/// give the same bytes.
VectorSet vector_set();

/// Returns whether the processor has an instruction that counts bits (POPCNT).
bool has_popcnt();

}  // namespace slambed
