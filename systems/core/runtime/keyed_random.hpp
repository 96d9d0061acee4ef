// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "base/random.hpp"

namespace slambed {

/// Counter-based random numbers: each depends only on its key, so an additional draw does not shift
/// the others.

/// FNV-1a, because std::hash may differ between machines.
constexpr std::uint64_t hash_name(std::string_view name) {
  std::uint64_t hash = 0xCBF29CE484222325u;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3u;
  return hash;
}

/// Approximately standard normal: the sum of twelve uniforms minus six (Irwin-Hall).
constexpr double keyed_normal(std::uint64_t key) {
  double sum = -6;
  for (std::uint64_t i = 0; i < 12; ++i) sum += unit_interval(mix(key + (i << 48))) + 0x1p-54;
  return sum;
}

}  // namespace slambed
