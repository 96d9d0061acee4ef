// SPDX-License-Identifier: Apache-2.0
#include "synth/texture.hpp"

#include <algorithm>
#include <cmath>

namespace slambed::synth {
namespace {

void repeat_border(std::uint8_t* data, int width, int height) {
  const int stride = width + 1;
  for (int y = 0; y < height; ++y) data[y * stride + width] = data[y * stride + width - 1];
  std::copy_n(data + (height - 1) * stride, stride, data + height * stride);
}

}  // namespace

Texture::Texture(double width_m, double height_m, double texel_m)
    : width_(std::max(2, static_cast<int>(std::ceil(width_m / texel_m)))),
      height_(std::max(2, static_cast<int>(std::ceil(height_m / texel_m)))),
      texels_per_m_(1 / texel_m),
      texels_(static_cast<std::size_t>(width_ + 1) * (height_ + 1), 128) {}

void Texture::finish() {
  repeat_border(texels_.data(), width_, height_);
  levels_ = {{texels_.data(), width_ + 1, width_ - 1, height_ - 1}};
  mips_.clear();
  mips_.reserve(kMaxLevels);
  int w = width_, h = height_;
  while ((w > 1 || h > 1) && levels() < kMaxLevels) {
    const Level above = levels_.back();
    const int half_w = (w + 1) / 2, half_h = (h + 1) / 2;
    std::vector<std::uint8_t> mip(static_cast<std::size_t>(half_w + 1) * (half_h + 1));
    for (int y = 0; y < half_h; ++y) {
      // With an odd size the repeated border replaces the missing neighbor.
      const std::uint8_t* a = above.data + 2 * y * above.stride;
      const std::uint8_t* b = a + above.stride;
      for (int x = 0; x < half_w; ++x)
        mip[y * (half_w + 1) + x] =
            static_cast<std::uint8_t>((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) / 4);
    }
    repeat_border(mip.data(), half_w, half_h);
    mips_.push_back(std::move(mip));
    levels_.push_back({mips_.back().data(), half_w + 1, half_w - 1, half_h - 1});
    w = half_w;
    h = half_h;
  }
}

}  // namespace slambed::synth
