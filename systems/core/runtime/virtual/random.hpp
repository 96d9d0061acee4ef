// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace slambed {

/// Counter-based randomness: every value is a function of its key alone, so one decision more or
/// less never shifts the others. No libm: its last bits differ between processors.

/// SplitMix64 (Steele, Lea, Flood 2014): one well-mixed word per counter value.
constexpr std::uint64_t mix(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// FNV-1a: std::hash may differ between machines.
constexpr std::uint64_t hash_name(std::string_view name) {
  std::uint64_t hash = 0xCBF29CE484222325u;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3u;
  return hash;
}

/// Uniform in (0, 1).
constexpr double uniform(std::uint64_t key) {
  return (static_cast<double>(mix(key) >> 11) + 0.5) * 0x1p-53;
}

/// Approximately standard normal: sum of twelve uniforms less six (Irwin-Hall).
constexpr double normal(std::uint64_t key) {
  double sum = -6;
  for (std::uint64_t i = 0; i < 12; ++i) sum += uniform(key + (i << 48));
  return sum;
}

/// exp by halving the argument until a short Taylor series is exact to rounding; for |x| up to 10.
constexpr double portable_exp(double x) {
  constexpr int kHalvings = 10;
  const double y = x / (1 << kHalvings);
  double term = 1, sum = 1;
  for (int i = 1; i <= 6; ++i) sum += term *= y / i;
  for (int i = 0; i < kHalvings; ++i) sum *= sum;
  return sum;
}

}  // namespace slambed
