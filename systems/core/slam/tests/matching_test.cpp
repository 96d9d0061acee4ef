// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "slam/matching.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

TEST(RotationCheck, KeepsTheThreeFullestBins) {
  RotationCheck check;
  int feature = 0;
  const auto add = [&](float turn, int count) {
    for (int i = 0; i < count; ++i) check.add(turn, 0, feature++);
  };
  add(0, 50);   // 0..49
  add(60, 20);  // 50..69
  add(120, 6);  // 70..75
  add(180, 3);  // 76..78
  const auto rejected = check.disagreeing();
  ASSERT_EQ(rejected.size(), 3u);
  EXPECT_EQ(rejected.front(), 76);
}

TEST(RotationCheck, SmallSecondAndThirdBinsAreDropped) {
  RotationCheck check;
  for (int i = 0; i < 50; ++i) check.add(359, 0, i);  // rounds to the bin of 0 degrees
  check.add(1, 0, 50);
  for (int i = 0; i < 4; ++i) check.add(90, 0, 51 + i);
  EXPECT_EQ(check.disagreeing().size(), 4u);
}

TEST(Viewpoint, SeesOnlyWhatIsInFrontInRangeAndFacing) {
  const SyntheticScene scene(1);
  const Viewpoint camera(*scene.sensor(), SE3());
  PointSketch point;
  point.p_w = {0.1, 0.2, 2};
  point.normal = {0, 0, 1};
  point.min_distance_m = 1;
  point.max_distance_m = 3;
  Projection at;
  ASSERT_TRUE(camera.sees(point, at));
  EXPECT_NEAR(at.u, 345, 1e-3);
  EXPECT_NEAR(at.v, 290, 1e-3);
  EXPECT_NEAR(at.right_u, 345 - 20, 1e-3);
  PointSketch other = point;
  other.p_w.z() = -2;
  EXPECT_FALSE(camera.sees(other, at));
  other = point;
  other.p_w.x() = 2;
  EXPECT_FALSE(camera.sees(other, at));
  other = point;
  other.max_distance_m = 1.6f;  // times 1.2 is less than 2 m
  EXPECT_FALSE(camera.sees(other, at));
  other = point;
  other.min_distance_m = 2.6f;
  EXPECT_FALSE(camera.sees(other, at));
  other = point;
  other.normal = {0, 0.954f, 0.3f};  // more than 60 degrees off the viewing ray
  EXPECT_FALSE(camera.sees(other, at));
}

TEST(Matcher, FindsTheBestTwoAndRespectsTheRightImage) {
  const SyntheticScene scene(1);
  std::vector<KeyPoint> keypoints(4);
  std::vector<Descriptor> descriptors(4);
  for (int i = 0; i < 4; ++i) {
    keypoints[i].u = 100 + static_cast<float>(i);
    keypoints[i].v = 100;
    keypoints[i].octave = static_cast<std::uint8_t>(i % 2);
    descriptors[i][0] = (std::uint64_t{1} << i) - 1;  // i bits set
  }
  keypoints[0].right_u = 50;  // the projection expects 90
  keypoints[0].depth_m = 1;
  const FeatureSet features(scene.sensor(), keypoints, descriptors);
  Matcher matcher;
  const Descriptor wanted{};
  Matcher::Query query;
  query.at.u = query.at.v = 100;
  query.at.right_u = 90;
  query.radius_px = 10;
  query.max_octave = 7;
  query.descriptor = &wanted;
  auto best = matcher.search(features, query, [](int) { return true; });
  EXPECT_EQ(best.feature, 1);
  EXPECT_EQ(best.distance, 1);
  EXPECT_EQ(best.octave, 1);
  EXPECT_EQ(best.second_distance, 2);
  EXPECT_EQ(best.second_octave, 0);
  best = matcher.search(features, query, [](int i) { return i != 1; });
  EXPECT_EQ(best.feature, 2);
  query.radius_px = 1.5f;
  query.min_octave = 2;
  EXPECT_EQ(matcher.search(features, query, [](int) { return true; }).feature, -1);
}

TEST(Matcher, MatchesAllByDescriptorAlone) {
  SyntheticScene scene;
  const auto a = scene.look(walk(0));
  const std::vector<int> seen_a = scene.seen();
  const auto b = scene.look(walk(8), {.flipped_bits = 10});
  const std::vector<int> seen_b = scene.seen();
  std::vector<Matcher::Seen> points;
  for (int i = 0; i < a->size(); ++i)
    points.push_back({&a->descriptor(i), a->keypoint(i).angle_deg});
  Matcher matcher;
  const auto matches = matcher.match_all(points, *b, 0.7f);
  EXPECT_GT(matches.size(), 500u);
  for (const auto& [p, feature] : matches) EXPECT_EQ(seen_a[p], seen_b[feature]);
}

}  // namespace
}  // namespace slambed::testing
