// SPDX-License-Identifier: Apache-2.0
#include "synth/painter.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace slambed::synth {
namespace {

struct Interval {
  double low, high;
  void cut(double other_low, double other_high) {
    low = std::max(low, other_low);
    high = std::min(high, other_high);
  }
};

/// Returns the part of a row (offset dy from the center) inside the slab |a dx + b dy| <= r.
Interval slab(double a, double b, double dy, double r) {
  const double offset = b * dy;
  if (std::abs(a) < 1e-9) return std::abs(offset) <= r ? Interval{-1e9, 1e9} : Interval{1, -1};
  const double x0 = (-r - offset) / a, x1 = (r - offset) / a;
  return {std::min(x0, x1), std::max(x0, x1)};
}

enum class Shape { kDisk, kRectangle, kTriangle };

struct Leaf {
  Shape shape = Shape::kDisk;
  double x = 0, y = 0, r = 0, aspect = 1;
  SinCos turn;
  std::uint8_t gray = 0;

  Interval row(double dy) const {
    const double c = turn.cos, s = turn.sin;
    if (shape == Shape::kDisk) {
      const double left = r * r - dy * dy;
      const double half = left > 0 ? std::sqrt(left) : -1;
      return {-half, half};
    }
    Interval span = slab(c, s, dy, r);
    if (shape == Shape::kRectangle) {
      const Interval other = slab(-s, c, dy, r * aspect);
      span.cut(other.low, other.high);
    } else {  // two slanted sides meeting on the axis
      for (const double side : {0.5, -0.5}) {
        const Interval other = slab(c * side - s, s * side + c, dy, r * 0.8 * aspect);
        span.cut(other.low, other.high);
      }
    }
    return span;
  }

  void draw(Texture& texture) const {
    const double reach = shape == Shape::kDisk ? r : r * 1.75;
    const int y0 = std::max(0, static_cast<int>(std::ceil(y - reach)));
    const int y1 = std::min(texture.height() - 1, static_cast<int>(std::floor(y + reach)));
    for (int row_y = y0; row_y <= y1; ++row_y) {
      const Interval span = row(row_y - y);
      const double from = std::max(0.0, std::ceil(x + span.low));
      const double to = std::min(texture.width() - 1.0, std::floor(x + span.high));
      if (from > to) continue;
      std::memset(texture.row(row_y) + static_cast<int>(from), gray,
                  static_cast<std::size_t>(to - from) + 1);
    }
  }
};

std::uint8_t to_gray(double value) {
  return static_cast<std::uint8_t>(std::clamp(value, 2.0, 253.0));
}

void paint_joints(Texture& texture, double spacing_texels, std::uint8_t gray) {
  const int width = std::max(1, static_cast<int>(spacing_texels / 60));
  for (double p = spacing_texels; p < texture.height(); p += spacing_texels)
    for (int y = static_cast<int>(p); y < std::min(texture.height(), static_cast<int>(p) + width);
         ++y)
      std::memset(texture.row(y), gray, texture.width());
  for (double p = spacing_texels; p < texture.width(); p += spacing_texels)
    for (int y = 0; y < texture.height(); ++y)
      for (int x = static_cast<int>(p); x < std::min(texture.width(), static_cast<int>(p) + width);
           ++x)
        texture.row(y)[x] = gray;
}

void paint_mark(Texture& texture, const Mark& mark) {
  const double per_m = texture.texels_per_m();
  const auto texel = [&](double at_m, int size) {
    return std::clamp(static_cast<int>(at_m * per_m + 0.5), 0, size);
  };
  const int left = texel(mark.s_m, texture.width());
  const int right = texel(mark.s_m + mark.width_m, texture.width());
  const int top = texel(mark.t_m + mark.height_m, texture.height());
  for (int y = texel(mark.t_m, texture.height()); y < top; ++y)
    if (left < right)
      std::memset(texture.row(y) + left, to_gray(mark.gray),
                  static_cast<std::size_t>(right - left));
}

}  // namespace

Material leafy(double gray, double contrast, double texel_m, double largest_m, double coverage,
               double texel_scale) {
  Material m;
  m.gray = gray;
  m.contrast = contrast;
  m.texel_m = texel_m * texel_scale;
  m.smallest_m = 1.6 * texel_m;
  m.largest_m = largest_m;
  m.coverage = coverage;
  return m;
}

void paint(Texture& texture, const Material& m, Random random) {
  const double per_m = texture.texels_per_m();
  const double smallest = std::max(1.0, m.smallest_m * per_m);
  const double largest = std::max(1.5 * smallest, m.largest_m * per_m);
  for (int y = 0; y < texture.height(); ++y)
    std::memset(texture.row(y), to_gray(m.gray), texture.width());
  // Half sizes follow r^-3 between smallest and largest, so every octave covers the same area. A
  // leaf covers about 3 r^2, averaged over the shapes.
  const double shrink = 1 - (smallest / largest) * (smallest / largest);
  double octaves = 0;
  for (double r = smallest; r < largest; r *= 2) octaves += 1;
  const double mean_area = 3 * 2 * smallest * smallest * 0.693 * octaves / shrink;
  const double area = static_cast<double>(texture.width()) * texture.height();
  const auto count = static_cast<int>(m.coverage * area / mean_area) + 1;
  for (int i = 0; i < count; ++i) {
    Leaf leaf;
    leaf.shape = static_cast<Shape>(random.below(3));
    leaf.r = smallest / std::sqrt(1 - random.uniform() * shrink);
    leaf.x = random.uniform(0, texture.width());
    leaf.y = random.uniform(0, texture.height());
    leaf.aspect = random.uniform(0.35, 1);
    leaf.turn = sincos_turns(random.uniform());
    leaf.gray = to_gray(m.gray + m.contrast * random.uniform(-1, 1));
    leaf.draw(texture);
  }
  if (m.grid_m > 0) paint_joints(texture, m.grid_m * per_m, to_gray(m.gray * 0.45));
  for (const Mark& mark : m.marks) paint_mark(texture, mark);
}

}  // namespace slambed::synth
