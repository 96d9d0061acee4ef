// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace slambed {

/// Vector instructions that kernels are written for. Each set contains those before it.
enum class VectorSet {
  kPortable,  ///< 16-byte vectors: SSE2, NEON, or plain loops
  kAvx2,      ///< 32 bytes
  kAvx512,    ///< 64 bytes: F, BW, DQ, VL and VPOPCNTDQ (Ice Lake, Zen 4 and later)
};

/// The largest set that this processor and its system can run. With glibc it is what
/// GLIBC_TUNABLES=glibc.cpu.hwcaps leaves, so that one machine can show that all give the same
/// bytes.
VectorSet vector_set();

/// The processor counts bits in one instruction.
bool has_popcnt();

}  // namespace slambed
