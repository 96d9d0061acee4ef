// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace slambed {

/// Returns, as one line of JSON, what the results of a virtual run depend on besides inputs and
/// sources: compiler and library versions (docs/explanation/virtual-time.md, "Same bytes"). It is
/// part of the run key. x86-64 and arm64 give the same bytes; others were never compared.
inline std::string machine_json(const std::string& libraries) {
#if defined(__x86_64__) || defined(__aarch64__)
  const std::string architecture;
#else
  const std::string architecture = R"("architecture": "other", )";
#endif
#if defined(__clang__)
  const std::string compiler = __VERSION__;  // starts with the compiler's name
#else
  const std::string compiler = std::string("gcc ") + __VERSION__;
#endif
#if defined(_GLIBCXX_RELEASE)  // also defined by clang with libstdc++
  const std::string standard_library = "libstdcxx " + std::to_string(_GLIBCXX_RELEASE);
#elif defined(_LIBCPP_VERSION)
  const std::string standard_library = "libcxx " + std::to_string(_LIBCPP_VERSION);
#else
  const std::string standard_library = "unknown";
#endif
  return "{" + architecture + R"("compiler": ")" + compiler + R"(", "standard_library": ")" +
         standard_library + R"(", "libraries": ")" + libraries + "\"}";
}

}  // namespace slambed
