// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "map_fixture.hpp"

namespace slambed::testing {
namespace {

/// Adds points 1..120 and keyframe 1.
void begin(Map& map) {
  MapDelta delta;
  for (int n = 1; n <= 120; ++n) delta.points.push_back(new_point(n));
  delta.keyframes = {new_keyframe(1, points_from(1, 40))};
  map.commit(delta);
}

void add(Map& map, std::uint64_t n, std::uint64_t first_point, KeyFrameId parent = {}) {
  MapDelta delta;
  delta.keyframes = {new_keyframe(n, points_from(first_point, 40))};
  delta.keyframes[0].parent = parent;
  map.commit(delta);
}

KeyFrameId parent(const Map& map, std::uint64_t n) {
  return map.read([&](const MapView& view) { return view.keyframe(kf(n))->parent; });
}

TEST(SpanningTree, ParentIsTheBestCovisibleAtFirstConnection) {
  Map map;
  begin(map);
  add(map, 2, 11);
  add(map, 3, 21);
  EXPECT_FALSE(parent(map, 1));
  EXPECT_EQ(parent(map, 2), kf(1));
  EXPECT_EQ(parent(map, 3), kf(2));
  add(map, 4, 22);  // now the best covisible of 3, but a parent does not change
  EXPECT_EQ(parent(map, 3), kf(2));
}

TEST(SpanningTree, NamedParentIsTaken) {
  Map map;
  begin(map);
  add(map, 2, 11);
  add(map, 3, 12, kf(1));
  EXPECT_EQ(parent(map, 3), kf(1));
}

TEST(SpanningTree, BatchOfKeyFramesHasNoCycle) {
  Map map;
  MapDelta delta;
  for (int n = 1; n <= 80; ++n) delta.points.push_back(new_point(n));
  for (int k = 4; k <= 9; ++k) delta.keyframes.push_back(new_keyframe(k, points_from(k, 40)));
  delta.keyframes[2].parent = kf(2);  // not part of this delta
  map.commit(delta);
  map.read([](const MapView& view) {
    EXPECT_EQ(view.origin(), kf(4));
    for (const KeyFrameId id : view.keyframe_ids()) {
      int steps = 0;
      KeyFrameId at = id;
      while (view.keyframe(at)->parent && ++steps < 10) at = view.keyframe(at)->parent;
      EXPECT_EQ(at, kf(4));
    }
    return 0;
  });
}

TEST(SpanningTree, ChildrenOfACulledKeyFrameGoToTheirStrongestFriend) {
  Map map;
  begin(map);
  add(map, 2, 11);
  add(map, 3, 21, kf(2));  // shares 20 with 1 and 30 with 2
  add(map, 4, 26, kf(2));  // shares 15 with 1, 35 with 3
  MapDelta cull;
  cull.culled_keyframes = {kf(2)};
  map.commit(cull);
  EXPECT_EQ(parent(map, 3), kf(1));
  EXPECT_EQ(parent(map, 4), kf(3));
  map.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe(kf(1))->children, std::vector<KeyFrameId>{kf(3)});
    EXPECT_EQ(view.keyframe(kf(3))->children, std::vector<KeyFrameId>{kf(4)});
    return 0;
  });
}

TEST(SpanningTree, PoseOfACulledKeyFrameFollowsItsParent) {
  Map map;
  begin(map);
  add(map, 2, 11);
  add(map, 3, 21);
  const SE3 T_3w = *map.read([](const MapView& view) { return view.pose_of(kf(3)); });
  MapDelta cull;
  cull.culled_keyframes = {kf(3)};
  map.commit(cull);
  cull.culled_keyframes = {kf(2)};  // the parent goes too
  map.commit(cull);
  const auto pose = [&] { return *map.read([](const MapView& v) { return v.pose_of(kf(3)); }); };
  EXPECT_LT((pose().t - T_3w.t).norm(), 1e-12);
  const SE3 T_1w = *map.read([](const MapView& view) { return view.pose_of(kf(1)); });
  const SE3 moved(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix(), {1, 2, 3});
  MapDelta move;
  move.poses = {{kf(1), moved, 1}};
  map.commit(move);
  const SE3 expected = T_3w * T_1w.inverse() * moved;
  EXPECT_LT((pose().t - expected.t).norm(), 1e-12);
  EXPECT_LT((pose().R - expected.R).norm(), 1e-12);
}

TEST(SpanningTree, CullingTheOriginLeavesOneRoot) {
  Map map;
  begin(map);
  add(map, 2, 11);
  add(map, 3, 1, kf(1));
  add(map, 4, 11, kf(3));
  const SE3 T_1w = *map.read([](const MapView& view) { return view.pose_of(kf(1)); });
  MapDelta cull;
  cull.culled_keyframes = {kf(1)};
  map.commit(cull);
  map.read([&](const MapView& view) {
    EXPECT_EQ(view.origin(), kf(2));
    EXPECT_FALSE(view.keyframe(kf(2))->parent);
    int roots = 0;
    for (const KeyFrameId id : view.keyframe_ids()) roots += !view.keyframe(id)->parent;
    EXPECT_EQ(roots, 1);
    EXPECT_LT((view.pose_of(kf(1))->t - T_1w.t).norm(), 1e-12);
    return 0;
  });
}

}  // namespace
}  // namespace slambed::testing
