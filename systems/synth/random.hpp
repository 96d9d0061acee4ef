// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/random.hpp"

namespace slambed::synth {

// Everything random or periodic in the generator comes from here and uses only IEEE + - * / and
// integers, so that a seed gives the same bytes with any compiler, libm or processor.

/// Random stream of one object of the scene.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0)
      : words_((mix(seed) ^ mix(~stream)) + kGoldenGamma) {}

  std::uint64_t bits() { return words_.next(); }
  double uniform() { return words_.uniform(); }
  double uniform(double low, double high) { return words_.uniform(low, high); }
  /// Uses the upper bits, not the remainder as SplitMix64 does, so that scenes keep their bytes.
  int below(int n) {
    return static_cast<int>((bits() >> 32) * static_cast<std::uint64_t>(n) >> 32);
  }

 private:
  SplitMix64 words_;
};

/// Approximates a standard normal by the sum of a hash's four bytes.
constexpr float bell(std::uint32_t hash) {
  const int sum =
      static_cast<int>((hash & 255) + (hash >> 8 & 255) + (hash >> 16 & 255) + (hash >> 24));
  return static_cast<float>(sum - 510) *
         (1.0f / 147.8f);  // 4 bytes: sd = sqrt(4 * (256^2 - 1) / 12)
}

struct SinCos {
  double sin = 0, cos = 1;
};

/// Sine and cosine of an angle in full turns, accurate to about 1e-15.
inline SinCos sincos_turns(double turns) {
  const double quarter = turns * 4;
  const auto nearest = static_cast<std::int64_t>(quarter + (quarter < 0 ? -0.5 : 0.5));
  const double a = (quarter - static_cast<double>(nearest)) * 1.5707963267948966;
  const double a2 = a * a;
  const double s =
      a * (1 - a2 / 6 *
                   (1 - a2 / 20 * (1 - a2 / 42 * (1 - a2 / 72 * (1 - a2 / 110 * (1 - a2 / 156))))));
  const double c =
      1 - a2 / 2 * (1 - a2 / 12 * (1 - a2 / 30 * (1 - a2 / 56 * (1 - a2 / 90 * (1 - a2 / 132)))));
  switch (nearest & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

inline SinCos sincos_deg(double degrees) { return sincos_turns(degrees / 360); }

}  // namespace slambed::synth
