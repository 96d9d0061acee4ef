// SPDX-License-Identifier: Apache-2.0
#include "synth/renderer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "synth/generator.hpp"

namespace slambed::synth {
namespace {

/// The default room with coarse textures, built once for all tests.
std::shared_ptr<const Scene> room() {
  static const auto scene = make_room({.texel_scale = 2, .threads = 2}, {});
  return scene;
}

Camera camera() { return generator_camera({}); }

float bilinear(const std::vector<float>& image, int width, double u, double v) {
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const auto a = static_cast<float>(u - x), b = static_cast<float>(v - y);
  const float* p = image.data() + y * width + x;
  return (1 - b) * ((1 - a) * p[0] + a * p[1]) + b * ((1 - a) * p[width] + a * p[width + 1]);
}

TEST(Renderer, DepthOfABoxIsExact) {
  auto scene = std::make_shared<Scene>();
  scene->add_box({2.5, 0, 0}, {1, 2, 2}, Material{.texel_m = 0.05});  // its near side is at x = 2
  scene->finish({}, 1, 1);
  Renderer renderer(scene, camera());
  const SE3 T_wc(look(0, 0, 0), Vec3(0, 0, 1));
  const Picture picture = renderer.render(T_wc, 0);
  const int w = picture.width;
  EXPECT_NEAR(picture.depth_m[240 * w + 320], 2, 1e-5);
  EXPECT_NEAR(picture.depth_m[60 * w + 100], 2, 1e-5);
  // The near side is 2 m wide at a depth of 2 m: 525 px. Outside of it there is no surface.
  EXPECT_EQ(picture.depth_m[240 * w + 50], 0);
  int column = 0;
  for (int x = 0; x < w; ++x) column += picture.depth_m[240 * w + x] > 0;
  EXPECT_NEAR(column, 525, 1);
}

TEST(Renderer, NearerThingsHideFartherOnes) {
  Renderer renderer(room(), camera());
  const Picture picture = renderer.render(make_path("still", 0, 1)->at(0), 0);
  int empty = 0;
  for (const float z : picture.depth_m) empty += z <= 0;
  EXPECT_LT(empty, 20);  // in a closed room only cracks between faces have no surface
}

TEST(Renderer, WarpingOnePictureByItsDepthGivesTheOther) {
  const auto path = make_path("office", 0, 3);
  const Camera c = camera();
  Renderer renderer(room(), c);
  const SE3 T_wa = path->at(10), T_wb = path->at(10.3);
  const Picture a = renderer.render(T_wa, 10), b = renderer.render(T_wb, 10.3);
  const SE3 T_ba = T_wb.inverse() * T_wa;
  int inside = 0, same_depth = 0;
  double difference = 0, contrast = 0;
  for (int y = 0; y < c.height; y += 3) {
    for (int x = 0; x < c.width; x += 3) {
      const float z = a.depth_m[y * c.width + x];
      const Vec3 p = T_ba * c.unproject(x, y, z);
      const Eigen::Vector2d uv = c.project(p);
      if (p.z() <= 0 || uv.x() < 1 || uv.y() < 1) continue;
      if (uv.x() > c.width - 3 || uv.y() > c.height - 3) continue;
      ++inside;
      const double seen = bilinear(b.depth_m, c.width, uv.x(), uv.y());
      if (std::abs(seen - p.z()) > 0.005 * p.z()) continue;
      ++same_depth;
      difference += std::abs(bilinear(b.gray, c.width, uv.x(), uv.y()) - a.gray[y * c.width + x]);
      const double elsewhere = bilinear(b.gray, c.width, uv.x(), std::max(1.0, uv.y() - 20));
      contrast += std::abs(elsewhere - a.gray[y * c.width + x]);
    }
  }
  ASSERT_GT(inside, 20000);
  EXPECT_GT(same_depth, 0.93 * inside);  // the rest is occluded in one of the pictures
  // Unrelated pixels differ several times as much.
  EXPECT_LT(difference / same_depth, 5);
  EXPECT_GT(contrast / same_depth, 4 * difference / same_depth);
}

}  // namespace
}  // namespace slambed::synth
