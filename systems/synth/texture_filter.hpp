// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "synth/texture.hpp"

namespace slambed::synth {

/// Derivatives of the texture position, in texels per pixel to the right (dx) and down (dy).
struct Footprint {
  float s_dx, t_dx, s_dy, t_dy;
};

/// Reads a texture without aliasing: trilinear in the mip levels, with up to four probes along the
/// longer axis of a slanted footprint.
class TextureFilter {
 public:
  explicit TextureFilter(const Texture& texture)
      : levels_(texture.level_data()), last_level_(texture.levels() - 1) {}

  float read(float s, float t, const Footprint& f) const {
    const float right2 = f.s_dx * f.s_dx + f.t_dx * f.t_dx;
    const float down2 = f.s_dy * f.s_dy + f.t_dy * f.t_dy;
    const bool right_is_longer = right2 > down2;
    const float longer2 = right_is_longer ? right2 : down2;
    const float area = f.s_dx * f.t_dy - f.t_dx * f.s_dy;
    // Shorter axis of the pixel's parallelogram, but never thinner than the probes can cover.
    const float shorter2 = std::max(area * area / longer2, longer2 * (1.0f / 16));
    const float level = 0.5f * log2_about(shorter2);
    const float along_s = right_is_longer ? f.s_dx : f.s_dy;
    const float along_t = right_is_longer ? f.t_dx : f.t_dy;
    if (longer2 < 2.5f * shorter2) return trilinear(s, t, level);
    if (longer2 < 7 * shorter2)
      return 0.5f * (trilinear(s - 0.25f * along_s, t - 0.25f * along_t, level) +
                     trilinear(s + 0.25f * along_s, t + 0.25f * along_t, level));
    float sum = 0;
    for (const float at : {-0.375f, -0.125f, 0.125f, 0.375f})
      sum += trilinear(s + at * along_s, t + at * along_t, level);
    return 0.25f * sum;
  }

 private:
  /// Approximate log2: exact at powers of two, linear between them.
  static float log2_about(float x) {
    const auto bits = std::bit_cast<std::uint32_t>(x);
    return static_cast<float>(static_cast<std::int32_t>(bits) - 0x3f800000) * (1.0f / 8388608);
  }

  static int bilinear(const Texture::Level& level, float u, float v) {
    u = std::clamp(u, 0.0f, static_cast<float>(level.max_x));
    v = std::clamp(v, 0.0f, static_cast<float>(level.max_y));
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const int fx = static_cast<int>((u - static_cast<float>(x)) * 256);
    const int fy = static_cast<int>((v - static_cast<float>(y)) * 256);
    const std::uint8_t* a = level.data + y * level.stride + x;
    const std::uint8_t* b = a + level.stride;
    const int top = a[0] * 256 + (a[1] - a[0]) * fx, bottom = b[0] * 256 + (b[1] - b[0]) * fx;
    return top * 256 + (bottom - top) * fy;
  }

  float trilinear(float s, float t, float level) const {
    constexpr float kToGray = 1.0f / 65536;
    level = std::clamp(level, 0.0f, static_cast<float>(last_level_));
    const int fine = static_cast<int>(level);
    const float scale = 1 / static_cast<float>(1 << fine);
    const auto a = static_cast<float>(bilinear(levels_[fine], s * scale - 0.5f, t * scale - 0.5f));
    if (fine == last_level_ || level == 0) return a * kToGray;
    const auto b = static_cast<float>(
        bilinear(levels_[fine + 1], s * scale * 0.5f - 0.5f, t * scale * 0.5f - 0.5f));
    return (a + (b - a) * (level - static_cast<float>(fine))) * kToGray;
  }

  const Texture::Level* levels_;
  int last_level_;
};

}  // namespace slambed::synth
