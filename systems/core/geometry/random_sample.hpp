// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/random.hpp"

namespace slambed {

/// Returns N distinct numbers below count, which must be at least N.
template <std::size_t N>
std::array<std::size_t, N> draw_sample(SplitMix64& random, std::size_t count) {
  std::array<std::size_t, N> sample{};
  for (std::size_t i = 0; i < N; ++i) {
    do {
      sample[i] = random.below(count);
    } while (std::find(sample.begin(), sample.begin() + i, sample[i]) != sample.begin() + i);
  }
  return sample;
}

}  // namespace slambed
