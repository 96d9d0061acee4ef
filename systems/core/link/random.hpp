// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace slambed::link {

/// What a stream of random numbers is for. Each purpose has its own stream, so that switching one
/// impairment on does not change the draws of another.
enum class Stream : std::uint64_t { kLoss = 1, kLossState = 2, kJitter = 3 };

/// splitmix64 (Steele, Lea, Flood 2014): small, well mixed and the same on every platform, which
/// the distributions of <random> are not.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  Random(std::uint64_t seed, std::uint64_t direction, Stream stream) : state_(seed) {
    state_ = next() ^ (direction * 0xd1342543de82ef95ULL);
    state_ = next() ^ (static_cast<std::uint64_t>(stream) * 0x2545f4914f6cdd1dULL);
  }

  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

  /// Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }

  /// Standard normal by Box and Muller; the second value of a pair is not kept, one draw costs two
  /// uniforms and the stream position stays a function of the number of draws.
  double normal() {
    const double u = 1.0 - uniform();
    const double v = uniform();
    return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
  }

 private:
  std::uint64_t state_;
};

}  // namespace slambed::link
