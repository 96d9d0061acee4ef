// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace slambed {

/// What results of a virtual run hang on besides its inputs, as one line of JSON (docs/virtual.md,
/// "Same bytes"): what this program was compiled for.
inline std::string machine_json() {
#if defined(__x86_64__)
  const std::string architecture = "x86_64", floating_point = "sse2";
#elif defined(__aarch64__)
  const std::string architecture = "aarch64", floating_point = "neon, fused";
#else
  const std::string architecture = "other", floating_point = "unknown";
#endif
  return R"({"architecture": ")" + architecture + R"(", "floating_point": ")" + floating_point +
         R"(", "compiler": ")" + __VERSION__ + "\"}";
}

}  // namespace slambed
