// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace slambed {

/// One bit of the descriptor: is the (blurred) image darker at a than at b? Pixels from the
/// keypoint.
struct PatternTest {
  std::int8_t ax, ay, bx, by;
};

extern const std::array<PatternTest, 256> kOrbPattern;

/// No point of the pattern is farther from the keypoint than this, whatever the rotation (px).
inline constexpr int kPatternReach = 18;

}  // namespace slambed
