// SPDX-License-Identifier: Apache-2.0
#include "features/pyramid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr std::ptrdiff_t kLeftRoom = 64;  // aligns rows to cache lines; at least kBorder

std::ptrdiff_t round_up(std::ptrdiff_t value, std::ptrdiff_t step) {
  return (value + step - 1) / step * step;
}

}  // namespace

void PaddedPlane::resize(int width, int height) {
  width_ = width;
  height_ = height;
  stride_ = round_up(kLeftRoom + width + kBorder + kKernelSlack, 64);
  offset_ = kBorder * stride_ + kLeftRoom;
  bytes_.assign((height + 2 * kBorder) * stride_ + kKernelSlack, 0);
}

void PaddedPlane::mirror_border() {
  for (int y = 0; y < height_; ++y) {
    std::uint8_t* line = row(y);
    std::uint8_t* last = line + width_ - 1;
    std::uint8_t left[kBorder], right[kBorder];
    for (int i = 0; i < kBorder; ++i) {
      left[i] = line[kBorder - i];
      right[i] = last[-1 - i];
    }
    std::memcpy(line - kBorder, left, kBorder);
    std::memcpy(last + 1, right, kBorder);
  }
  const std::size_t bytes = width_ + 2 * kBorder;
  for (int i = 1; i <= kBorder; ++i) {
    std::memcpy(row(-i) - kBorder, row(i) - kBorder, bytes);
    std::memcpy(row(height_ - 1 + i) - kBorder, row(height_ - 1 - i) - kBorder, bytes);
  }
}

ResizeAxis::ResizeAxis(int from, int to) {
  const int padded = static_cast<int>(round_up(to, 2 * kResizeBlock));
  first_.resize(to);
  for (auto& weight : weight_) weight.assign(padded, 0);
  pair_weight_.assign(padded, 0);
  place_.assign(2 * static_cast<std::size_t>(padded), 0);
  block_first_.assign(padded / kResizeBlock, 0);
  const double step = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    // Output i covers [i, i + 1) * step of the input. Each input pixel is weighted by its share.
    const double begin = i * step, end = (i + 1) * step;
    const int first = std::clamp(static_cast<int>(begin), 0, std::max(0, from - 3));
    double share[3], before = 0;
    for (int k = 0; k < 3; ++k)
      share[k] =
          std::max(0.0, std::min<double>(first + k + 1, end) - std::max<double>(first + k, begin));
    first_[i] = static_cast<std::uint16_t>(first);
    for (int k = 0; k < 3; ++k) {  // rounding the running sum keeps the total at 256
      const double after = before + share[k] / step;
      weight_[k][i] =
          static_cast<std::uint16_t>(std::lround(256 * after) - std::lround(256 * before));
      before = after;
      if (weight_[k][i] > 255) fits_window_ = false;
    }
    pair_weight_[i] = static_cast<std::uint16_t>((weight_[0][i] & 255) | weight_[1][i] << 8);
    const int block = i / kResizeBlock;
    if (i % kResizeBlock == 0) block_first_[block] = static_cast<std::uint16_t>(first);
    const int place = first - block_first_[block];
    if (place + 3 > kResizeWindow) fits_window_ = false;
    place_[2 * i] = static_cast<std::uint8_t>(place);
    place_[2 * i + 1] = static_cast<std::uint8_t>(place + 1);
  }
}

ResizeTable ResizeAxis::table() const {
  return {size(),
          first_.data(),
          {weight_[0].data(), weight_[1].data(), weight_[2].data()},
          pair_weight_.data(),
          block_first_.data(),
          place_.data(),
          fits_window_};
}

ImagePyramid::ImagePyramid(std::vector<float> scale, const Kernels& kernels)
    : scale_(std::move(scale)), kernels_(kernels), planes_(scale_.size()) {
  steps_.resize(scale_.empty() ? 0 : scale_.size() - 1);
}

void ImagePyramid::prepare(int width, int height) {
  width_ = width;
  height_ = height;
  usable_ = 0;
  int w = width, h = height;
  for (std::size_t i = 0; i < scale_.size(); ++i) {
    const int level_w = static_cast<int>(std::lround(width / scale_[i]));
    const int level_h = static_cast<int>(std::lround(height / scale_[i]));
    if (level_w < kMinSide || level_h < kMinSide) break;
    if (i > 0) steps_[i - 1] = {ResizeAxis(w, level_w), ResizeAxis(h, level_h)};
    planes_[i].resize(level_w, level_h);
    w = level_w, h = level_h;
    ++usable_;
  }
  row_.assign(width + kKernelSlack + kResizeWindow, 0);
}

void ImagePyramid::build(GrayView image) {
  if (image.width != width_ || image.height != height_) prepare(image.width, image.height);
  if (usable_ == 0) return;
  for (int y = 0; y < image.height; ++y) std::memcpy(planes_[0].row(y), image.row(y), image.width);
  planes_[0].mirror_border();
  for (int i = 1; i < usable_; ++i) {
    const GrayView source = planes_[i - 1].view();
    const Step& step = steps_[i - 1];
    const ResizeTable x_table = step.x.table(), y_table = step.y.table();
    for (int y = 0; y < y_table.size; ++y) {
      const int first = y_table.first[y];
      const std::uint8_t* rows[3] = {source.row(first), source.row(first + 1),
                                     source.row(first + 2)};
      const std::uint16_t weights[3] = {y_table.weight[0][y], y_table.weight[1][y],
                                        y_table.weight[2][y]};
      kernels_.blend_rows(rows, weights, source.width, row_.data());
      kernels_.resize_row(row_.data(), x_table, planes_[i].row(y));
    }
    planes_[i].mirror_border();
  }
}

}  // namespace slambed
