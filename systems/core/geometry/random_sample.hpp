// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace slambed {

/// SplitMix64: the same seed draws the same samples on every machine.
inline std::uint64_t next_random(std::uint64_t& state) {
  std::uint64_t x = state += 0x9E3779B97F4A7C15u;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
  return x ^ (x >> 31);
}

/// N different numbers below count, which must be at least N.
template <std::size_t N>
std::array<std::size_t, N> draw_sample(std::uint64_t& state, std::size_t count) {
  std::array<std::size_t, N> sample{};
  for (std::size_t i = 0; i < N; ++i) {
    do {
      sample[i] = next_random(state) % count;
    } while (std::find(sample.begin(), sample.begin() + i, sample[i]) != sample.begin() + i);
  }
  return sample;
}

}  // namespace slambed
