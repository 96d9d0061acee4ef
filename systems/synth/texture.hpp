// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace slambed::synth {

/// Gray texture of one flat face with its mip levels. Texel (i, j) of level 0 covers
/// [i, i+1) x [j, j+1), in texels from the face's (s, t) origin.
class Texture {
 public:
  /// One mip level. The last row and column are repeated once, so bilinear reads need no bounds
  /// check.
  struct Level {
    const std::uint8_t* data = nullptr;
    int stride = 0;
    int max_x = 0, max_y = 0;  ///< last texel
  };
  static constexpr int kMaxLevels = 14;

  Texture() = default;
  Texture(double width_m, double height_m, double texel_m);

  int width() const { return width_; }
  int height() const { return height_; }
  double texels_per_m() const { return texels_per_m_; }
  std::uint8_t* row(int y) { return texels_.data() + static_cast<std::size_t>(y) * (width_ + 1); }
  /// Fills the borders and computes the mip levels; call once after painting.
  void finish();

  int levels() const { return static_cast<int>(levels_.size()); }
  const Level* level_data() const { return levels_.data(); }

 private:
  int width_ = 0, height_ = 0;
  double texels_per_m_ = 1;
  std::vector<std::uint8_t> texels_;
  std::vector<std::vector<std::uint8_t>> mips_;
  std::vector<Level> levels_;
};

}  // namespace slambed::synth
