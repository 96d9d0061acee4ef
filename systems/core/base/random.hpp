// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace slambed {

inline constexpr std::uint64_t kGoldenGamma = 0x9E3779B97F4A7C15u;

/// SplitMix64 (Steele, Lea, Flood 2014): one well-mixed word per counter value, the same on every
/// machine. The distributions of <random> differ between standard libraries.
constexpr std::uint64_t mix(std::uint64_t x) {
  x += kGoldenGamma;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// Returns the upper 53 bits of a word as a number in [0, 1).
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
  /// Uniform in [0, n). Takes the remainder, so n must be far below 2^64.
  constexpr std::uint64_t below(std::uint64_t n) { return next() % n; }
  /// Standard normal (Box-Muller). Discards the second value of each pair: every draw consumes two
  /// words, so the position of the stream depends only on the number of draws.
  double normal();

 private:
  std::uint64_t state_;
};

}  // namespace slambed
