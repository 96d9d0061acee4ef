// SPDX-License-Identifier: Apache-2.0
#include "synth/texture.hpp"

#include <gtest/gtest.h>

#include "synth/painter.hpp"
#include "synth/texture_filter.hpp"

namespace slambed::synth {
namespace {

TEST(Texture, MipLevelsHalveDownToOneTexelAndKeepTheMean) {
  Texture texture(0.37, 0.21, 0.01);
  paint(texture, Material{.gray = 120, .contrast = 80, .texel_m = 0.01}, Random(5));
  double mean = 0;
  for (int y = 0; y < texture.height(); ++y)
    for (int x = 0; x < texture.width(); ++x) mean += texture.row(y)[x];
  mean /= texture.width() * texture.height();
  texture.finish();
  ASSERT_EQ(texture.width(), 37);
  ASSERT_EQ(texture.levels(), 7);  // 37x21, 19x11, 10x6, 5x3, 3x2, 2x1, 1x1
  const auto& last = texture.level_data()[6];
  EXPECT_EQ(last.max_x, 0);
  EXPECT_EQ(last.max_y, 0);
  EXPECT_NEAR(last.data[0], mean, 12);  // odd sizes repeat their border
}

TEST(Texture, MagnifiedReadInterpolatesBetweenTexelCenters) {
  Texture texture(0.04, 0.04, 0.01);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x)
      texture.row(y)[x] = static_cast<std::uint8_t>(10 * x + 100 * (y > 1));
  texture.finish();
  const TextureFilter filter(texture);
  const Footprint tiny{0.1f, 0, 0, 0.1f};
  EXPECT_NEAR(filter.read(0.5f, 0.5f, tiny), 0, 0.1);
  EXPECT_NEAR(filter.read(1.0f, 0.5f, tiny), 5, 0.1);
  EXPECT_NEAR(filter.read(2.5f, 2.0f, tiny), 70, 0.2);
  EXPECT_NEAR(filter.read(-9.0f, 99.0f, tiny), 100, 0.1);  // outside, the border is extended
}

TEST(Texture, CheckerFinerThanThePixelGridReadsAsGray) {
  Texture texture(1.28, 1.28, 0.01);
  for (int y = 0; y < 128; ++y)
    for (int x = 0; x < 128; ++x) texture.row(y)[x] = (x + y) % 2 == 0 ? 0 : 200;
  texture.finish();
  const TextureFilter filter(texture);
  for (float at = 20; at < 100; at += 3.3f) {
    EXPECT_NEAR(filter.read(at, at, {4, 0, 0, 4}), 100, 2);
    EXPECT_NEAR(filter.read(at, at, {8, 0, 0, 2}), 100, 2);  // slanted
  }
}

}  // namespace
}  // namespace slambed::synth
