// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace slambed {

/// One bit of the descriptor: whether the blurred image is darker at a than at b. Offsets from the
/// keypoint, px.
struct PatternTest {
  std::int8_t ax, ay, bx, by;
};

extern const std::array<PatternTest, 256> kOrbPattern;

/// Largest distance of a pattern point from the keypoint at any rotation, px.
inline constexpr int kPatternReach = 18;

}  // namespace slambed
