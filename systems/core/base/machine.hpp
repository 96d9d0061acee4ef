// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace slambed {

/// What results of a virtual run hang on besides inputs and sources, as one line of JSON
/// (docs/virtual.md, "Same bytes"): what this program was compiled for, by what, and with which
/// versions of others' code. It is in the run key.
inline std::string machine_json(const std::string& libraries) {
#if defined(__x86_64__)
  const std::string architecture = "x86_64", floating_point = "sse2";
#elif defined(__aarch64__)
  const std::string architecture = "aarch64", floating_point = "neon, fused";
#else
  const std::string architecture = "other", floating_point = "unknown";
#endif
#if defined(__clang__)
  const std::string compiler = __VERSION__;  // names itself
#else
  const std::string compiler = std::string("gcc ") + __VERSION__;
#endif
  return R"({"architecture": ")" + architecture + R"(", "floating_point": ")" + floating_point +
         R"(", "compiler": ")" + compiler + R"(", "libraries": ")" + libraries + "\"}";
}

}  // namespace slambed
