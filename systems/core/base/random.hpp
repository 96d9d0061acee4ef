// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace slambed {

inline constexpr std::uint64_t kGoldenGamma = 0x9E3779B97F4A7C15u;

/// SplitMix64 (Steele, Lea, Flood 2014): one well-mixed word per counter value, the same on every
/// machine (the distributions of <random> are not).
constexpr std::uint64_t mix(std::uint64_t x) {
  x += kGoldenGamma;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// The 53 upper bits of a word as a number in [0, 1).
constexpr double unit_interval(std::uint64_t word) {
  return static_cast<double>(word >> 11) * 0x1p-53;
}

/// A stream of random words; equal seeds give equal streams.
class SplitMix64 {
 public:
  explicit constexpr SplitMix64(std::uint64_t seed) : state_(seed) {}

  constexpr std::uint64_t next() {
    const std::uint64_t word = mix(state_);
    state_ += kGoldenGamma;
    return word;
  }
  /// Uniform in [0, 1).
  constexpr double uniform() { return unit_interval(next()); }
  constexpr double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform below n (by remainder: n far below 2^64).
  constexpr std::uint64_t below(std::uint64_t n) { return next() % n; }
  /// Standard normal by Box and Muller. The second value of a pair is not kept: every draw costs
  /// two words, so that a stream's position is a function of the number of draws.
  double normal();

 private:
  std::uint64_t state_;
};

}  // namespace slambed
