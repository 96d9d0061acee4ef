// SPDX-License-Identifier: Apache-2.0
#include "features/instances.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr int kWidth = 100, kHeight = 50;

std::shared_ptr<Sensor> small_sensor() {
  auto made = std::make_shared<Sensor>();
  made->camera = {.width = kWidth, .height = kHeight, .fx = 80, .fy = 80, .cx = 50, .cy = 25};
  made->bounds = {0, 0, kWidth, kHeight};
  return made;
}

FeatureSet features_at(std::shared_ptr<const Sensor> with, std::vector<Eigen::Vector2f> pixels) {
  std::vector<KeyPoint> points(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    points[i].u = pixels[i].x();
    points[i].v = pixels[i].y();
  }
  return {std::move(with), points, std::vector<Descriptor>(points.size())};
}

/// Returns an instance that covers columns 40 to 59 of rows 20 to 29.
FrameMasks block(bool moves) {
  Instance found{
      .object_class = 0, .moves = moves, .score = 1, .runs = {20 * kWidth + 40}, .body = {}};
  for (int row = 0; row < 10; ++row) {
    found.runs.push_back(20);
    found.runs.push_back(row < 9 ? kWidth - 20 : 20 * kWidth + 40);
  }
  return {kWidth, kHeight, {found}};
}

using Kept = std::vector<std::uint8_t>;

TEST(Instances, FeaturesInAMaskAndWithinItsBorderGo) {
  EXPECT_EQ(defect(block(true)), "");
  const FeatureSet features =
      features_at(small_sensor(),
                  {{50, 25}, {40, 20}, {37, 25}, {36, 25}, {59, 32}, {59, 33}, {5, 5}, {99, 49}});
  EXPECT_EQ(features_off_masks(features, block(true), 3), (Kept{0, 0, 0, 1, 0, 1, 1, 1}));
  EXPECT_EQ(features_off_masks(features, block(true), 0), (Kept{0, 0, 1, 1, 1, 1, 1, 1}));
}

TEST(Instances, WhatDoesNotMoveKeepsItsFeatures) {
  const FeatureSet features = features_at(small_sensor(), {{50, 25}, {5, 5}});
  EXPECT_EQ(features_off_masks(features, block(false), 3), (Kept{1, 1}));
  EXPECT_EQ(features_off_masks(features, {kWidth, kHeight, {}}, 3), (Kept{1, 1}));
}

TEST(Instances, MasksLieInThePictureAsTheLensMadeIt) {
  auto bent = small_sensor();
  bent->camera.distortion = {-0.3, 0.1, 0, 0, 0};
  // Raw pixels just inside and just outside the mask, undistorted as extraction does.
  const auto ideal = [&](double u, double v) {
    return bent->camera.undistort(u, v).cast<float>().eval();
  };
  const FeatureSet features = features_at(bent, {ideal(41, 21), ideal(38, 21), ideal(2, 2)});
  EXPECT_GT(std::abs(features.keypoint(2).u - 2), 3);
  EXPECT_EQ(features_off_masks(features, block(true), 0), (Kept{0, 1, 1}));
}

TEST(Instances, MasksOfAnotherPictureAreRefused) {
  const FeatureSet features = features_at(small_sensor(), {{50, 25}});
  EXPECT_THROW(features_off_masks(features, {kWidth, kHeight + 1, {}}, 3), Error);
}

TEST(Instances, SayWhatIsWrongWithThem) {
  FrameMasks masks = block(true);
  masks.instances[0].runs.back() -= 1;
  EXPECT_EQ(defect(masks), "the runs of a mask do not cover the picture");
  masks = block(true);
  masks.instances[0].body.emplace();
  (*masks.instances[0].body)[16].u = NAN;
  EXPECT_EQ(defect(masks), "a key point is not finite");
}

}  // namespace
}  // namespace slambed
