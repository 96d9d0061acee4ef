// SPDX-License-Identifier: Apache-2.0
#include "synth/street.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "synth/renderer.hpp"

namespace slambed::synth {
namespace {

Camera small_camera() {
  Camera camera;
  camera.width = 160;
  camera.height = 90;
  camera.fx = camera.fy = 87.5;
  camera.cx = 79.5;
  camera.cy = 44.5;
  return camera;
}

std::shared_ptr<const Scene> coarse(const std::shared_ptr<const Drive>& drive, int cars = 0,
                                    int open = 0) {
  return make_street({.seed = 4, .passing_cars = cars, .open_stretches = open, .texel_scale = 8},
                     drive);
}

TEST(Street, SkyAboveRoadBelowAndHousesBeside) {
  const auto drive = std::make_shared<const Drive>("block", 4);
  const auto scene = coarse(drive);
  Renderer renderer(scene, small_camera());
  double sky = 0, farthest = 0;
  int pictures = 0;
  for (double t = 2; t < drive->duration_s(); t += 3, ++pictures) {
    const Picture p = renderer.render(drive->at(t), t);
    // The road lies 1.45 m below the camera, which is pitched down by 2 degrees.
    const float below = p.depth_m[88 * 160 + 80];
    EXPECT_NEAR(below, 1.45 * 87.5 / (88 - 44.5 + 3.1), 0.35) << t;
    for (const float z : p.depth_m) {
      sky += z == 0;
      farthest = std::max<double>(farthest, z);
    }
  }
  sky /= pictures * 160.0 * 90;
  EXPECT_GT(sky, 0.03);
  EXPECT_LT(sky, 0.45);
  EXPECT_GT(farthest, 20);
}

TEST(Street, NothingStandsInTheLane) {
  for (const char* name : {"block", "rectangle"}) {
    const auto drive = std::make_shared<const Drive>(name, 2);
    const auto scene = make_street({.seed = 2, .texel_scale = 40}, drive);
    for (const Body& body : scene->bodies())
      for (int i = body.first_face; i < body.last_face; ++i)
        for (const Vec3& corner : scene->faces()[i].corners)
          if (corner.z() > 0.15 && corner.z() < 3) {
            ASSERT_GT(drive->route().distance_m(corner, 9), 1.6) << name;
          }
  }
}

TEST(Street, AFifthOfTheParkedCarsAreOthersInTheSecondLap) {
  const auto drive = std::make_shared<const Drive>("rectangle", 2);
  const auto scene = make_street({.seed = 2, .texel_scale = 40}, drive);
  int stay = 0, go = 0;
  for (const Body& body : scene->bodies()) {
    if (body.last_face - body.first_face < 60 || body.moving) continue;  // cars have many faces
    if (std::isinf(body.until_s) && std::isinf(body.from_s)) ++stay;
    if (!std::isinf(body.until_s)) {
      ++go;
      EXPECT_LT(body.until_s, drive->second_lap_s() + 20);
    }
  }
  EXPECT_GT(stay, 40);
  EXPECT_NEAR(static_cast<double>(go) / (stay + go), 0.2, 0.1);
}

/// Culling by bounding spheres must not change any pixel.
TEST(Street, CullingTakesNothingAway) {
  const auto drive = std::make_shared<const Drive>("block", 4);
  const auto scene = coarse(drive, 2);
  auto whole = std::make_shared<Scene>(*scene);
  whole->draw_everything();
  Renderer culled(scene, small_camera()), drawn(whole, small_camera());
  for (double t = 1; t < drive->duration_s(); t += 2.5) {
    const Picture a = culled.render(drive->at(t), t), b = drawn.render(drive->at(t), t);
    ASSERT_EQ(a.gray, b.gray) << t;
    ASSERT_EQ(a.depth_m, b.depth_m) << t;
  }
}

TEST(Street, PassingCarsComeTheOtherWay) {
  const auto drive = std::make_shared<const Drive>("block", 4);
  const auto scene = coarse(drive, 2);
  int seen = 0;
  for (const Body& body : scene->bodies()) {
    if (!body.moving) continue;
    ++seen;
    for (double t = 0; t < 20; t += 1) {
      const SE3 now = body.pose(t), next = body.pose(t + 0.1);
      const Vec3 step = next.t - now.t;
      EXPECT_GT(step.dot(now.R.col(0)), 0.3) << t;
      EXPECT_GT(drive->route().distance_m(now.t, 9), 2.5) << t;
    }
  }
  EXPECT_EQ(seen, 2);
}

TEST(Street, OpenStretchesHaveLessNearby) {
  const auto drive = std::make_shared<const Drive>("rectangle", 4);
  const auto faces = [&](int open) {
    return make_street({.seed = 4, .open_stretches = open, .texel_scale = 40}, drive)
        ->faces()
        .size();
  };
  EXPECT_LT(faces(4), faces(0));
}

}  // namespace
}  // namespace slambed::synth
