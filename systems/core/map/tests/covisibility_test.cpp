// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "map_fixture.hpp"

namespace slambed::testing {
namespace {

/// Chain of keyframes with forty points each. Neighbors share twenty points, keyframes two apart
/// share `far`.
MapDelta chain(int keyframes, int far) {
  MapDelta delta;
  const int step = 20;
  for (int n = 1; n <= keyframes * step + 40; ++n) delta.points.push_back(new_point(n));
  for (int k = 1; k <= keyframes; ++k) {
    auto numbers = points_from(1 + (k - 1) * step, 40);
    if (k > 2)  // replaces points by those of the keyframe two before
      for (int i = 0; i < far; ++i) numbers[39 - i] = 1 + (k - 3) * step + i;
    delta.keyframes.push_back(new_keyframe(k, numbers));
  }
  return delta;
}

std::vector<Covisible> covisibles(const Map& map, std::uint64_t n) {
  return map.read([&](const MapView& view) { return view.keyframe(kf(n))->covisibles; });
}

TEST(Covisibility, CountsSharedPointsHeaviestFirst) {
  Map map;
  map.commit(chain(3, 18));
  const auto of_first = covisibles(map, 1);
  ASSERT_EQ(of_first.size(), 2u);
  EXPECT_EQ(of_first[0].id, kf(2));
  EXPECT_EQ(of_first[0].weight, 20);
  EXPECT_EQ(of_first[1].id, kf(3));
  EXPECT_EQ(of_first[1].weight, 18);
}

TEST(Covisibility, WeakLinksAreListedOnlyWhenThereIsNothingBetter) {
  Map map;
  map.commit(chain(3, 10));
  EXPECT_EQ(covisibles(map, 1).size(), 1u);
  MapDelta weak;
  weak.keyframes = {new_keyframe(9, {1, 2, 3, 4, 5, 21})};  // shares 6 with 1, 5 with 3, 1 with 2
  map.commit(weak);
  const auto of_weak = covisibles(map, 9);
  ASSERT_EQ(of_weak.size(), 1u);
  EXPECT_EQ(of_weak[0].id, kf(1));
  EXPECT_EQ(of_weak[0].weight, 6);
}

TEST(Covisibility, FallsBackWhenTheStrongLinkIsCulled) {
  Map map;
  map.commit(chain(3, 10));
  MapDelta cull;
  cull.culled_keyframes = {kf(2)};
  map.commit(cull);
  const auto of_first = covisibles(map, 1);
  ASSERT_EQ(of_first.size(), 1u);
  EXPECT_EQ(of_first[0].id, kf(3));
  // Points seen only by keyframes 1 and 2 without depth are culled, so at most ten can remain.
  EXPECT_LE(of_first[0].weight, 10);
}

/// Keyframe 2 lists ten points of keyframe 1 and ten points that it created.
MapDelta second(bool observes_known) {
  MapDelta delta;
  for (int n = 101; n <= 110; ++n) {
    delta.points.push_back(new_point(n));
    delta.points.back().first_keyframe = delta.points.back().reference = kf(2);
  }
  auto numbers = points_from(1, 10);
  for (int n = 101; n <= 110; ++n) numbers.push_back(n);
  delta.keyframes = {new_keyframe(2, numbers)};
  delta.keyframes[0].observes_known = observes_known;
  return delta;
}

TEST(Covisibility, AKeyframeThatObservesOnlyWhatItMadeListsTheRest) {
  for (const bool observes_known : {true, false}) {
    Map map;
    map.commit(chain(1, 0));
    const Appearance before = map.read([](const MapView& v) { return v.point(pt(1))->appearance; });
    map.commit(second(observes_known));
    map.read([&](const MapView& view) {
      EXPECT_EQ(view.keyframe(kf(2))->points[0], pt(1)) << "listed";
      EXPECT_EQ(view.keyframe(kf(2))->connected.empty(), !observes_known);
      EXPECT_EQ(view.point(pt(1))->weight, observes_known ? 4 : 2);
      EXPECT_EQ(view.point(pt(101))->weight, 2) << "its own";
      EXPECT_EQ(view.point(pt(1))->appearance.normal == before.normal, !observes_known);
      return 0;
    });
    MapDelta gone;
    gone.culled_points = {pt(1)};
    gone.culled_keyframes = {kf(2)};
    map.commit(gone);
    map.read([&](const MapView& view) {
      EXPECT_EQ(view.point(pt(2)) == nullptr, observes_known) << "lost an observation, or none";
      return 0;
    });
  }
}

TEST(Covisibility, WhatIsOnlyListedIsGoneFromTheListWithThePoint) {
  Map map;
  map.commit(chain(1, 0));
  map.commit(second(false));
  MapDelta edit;
  edit.culled_points = {pt(1)};
  edit.fusions = {{pt(2), pt(30)}};
  map.commit(edit);
  map.read([&](const MapView& view) {
    EXPECT_FALSE(view.keyframe(kf(2))->points[0]);
    EXPECT_EQ(view.keyframe(kf(2))->points[1], pt(30)) << "still listed, by its survivor";
    EXPECT_TRUE(view.keyframe(kf(2))->connected.empty());
    return 0;
  });
}

}  // namespace
}  // namespace slambed::testing
