// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace slambed {

/// 256-bit oriented BRIEF descriptor.
using Descriptor = std::array<std::uint64_t, 4>;

/// One feature of a frame. Coordinates at pyramid level 0, undistorted, pixels.
struct KeyPoint {
  float u = 0, v = 0;
  float right_u = -1;   ///< column in the (virtual) right image; negative when there is no depth
  float depth_m = -1;   ///< negative when unknown
  float angle_deg = 0;  ///< orientation of the intensity centroid, [0, 360)
  std::uint8_t octave = 0;

  bool has_depth() const { return depth_m > 0; }
};

/// What the extractor itself finds, before undistortion and depth: raw pixel at level 0.
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

/// Matching limits of ORB-SLAM2 (bits of 256).
inline constexpr int kHammingHigh = 100;
inline constexpr int kHammingLow = 50;

}  // namespace slambed
