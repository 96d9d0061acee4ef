// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "features/image.hpp"
#include "features/kernels.hpp"

namespace slambed {

/// An image plane with padding: kBorder mirrored pixels on each side, and more beyond for kernels
/// that read and write whole vectors.
class PaddedPlane {
 public:
  static constexpr int kBorder = 8;

  void resize(int width, int height);
  std::uint8_t* row(int y) { return bytes_.data() + offset_ + y * stride_; }
  GrayView view() const { return {bytes_.data() + offset_, width_, height_, stride_}; }
  /// Fills the border by reflection about the outermost pixel (OpenCV's reflect-101).
  void mirror_border();

 private:
  std::vector<std::uint8_t> bytes_;
  std::ptrdiff_t stride_ = 0, offset_ = 0;
  int width_ = 0, height_ = 0;
};

/// Shrinks an axis of `from` pixels to `to` pixels (to <= from <= 2 * to).
class ResizeAxis {
 public:
  ResizeAxis() = default;
  ResizeAxis(int from, int to);
  int size() const { return static_cast<int>(first_.size()); }
  ResizeTable table() const;

 private:
  std::vector<std::uint16_t> first_, weight_[3], pair_weight_, block_first_;
  std::vector<std::uint8_t> place_;
  bool fits_window_ = true;
};

/// Image pyramid. Level i has the size of level 0 divided by scale[i], rounded, and is computed
/// from level i - 1.
class ImagePyramid {
 public:
  /// scale: size of level 0 divided by that of each level, ascending from 1, each step at most 2.
  ImagePyramid(std::vector<float> scale, const Kernels& kernels);

  void build(GrayView image);
  /// Number of levels of the last image whose sides are both at least kMinSide.
  int levels() const { return usable_; }
  GrayView level(int i) const { return planes_[i].view(); }
  static constexpr int kMinSide = 33;  ///< px; leaves one pixel that is 16 px from every border

 private:
  struct Step {
    ResizeAxis x, y;
  };
  void prepare(int width, int height);

  std::vector<float> scale_;
  const Kernels& kernels_;
  std::vector<PaddedPlane> planes_;
  std::vector<Step> steps_;  ///< steps_[i] computes level i + 1
  std::vector<std::uint8_t> row_;
  int width_ = 0, height_ = 0, usable_ = 0;
};

}  // namespace slambed
