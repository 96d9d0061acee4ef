// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace slambed {

/// 256-bit oriented BRIEF descriptor.
using Descriptor = std::array<std::uint64_t, 4>;

/// One feature of a frame. Coordinates are undistorted pixels at pyramid level 0.
struct KeyPoint {
  float u = 0, v = 0;
  float right_u = -1;   ///< column in the (virtual) right image; negative when there is no depth
  float depth_m = -1;   ///< negative when unknown
  float angle_deg = 0;  ///< orientation of the intensity centroid, [0, 360)
  std::uint8_t octave = 0;

  bool has_depth() const { return depth_m > 0; }
};

/// Output of the extractor before undistortion and depth. Coordinates are raw pixels at level 0.
struct RawKeyPoint {
  float x = 0, y = 0;
  float angle_deg = 0;
  std::uint8_t octave = 0;
  std::uint8_t response = 0;
};

inline int hamming(const Descriptor& a, const Descriptor& b) {
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
}

/// Matching thresholds of ORB-SLAM2, in bits of 256.
inline constexpr int kHammingHigh = 100;
inline constexpr int kHammingLow = 50;

}  // namespace slambed
