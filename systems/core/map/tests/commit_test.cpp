// SPDX-License-Identifier: Apache-2.0
// What each list of a delta does to the map, one concept per test.
#include <gtest/gtest.h>

#include "map_fixture.hpp"

namespace slambed::testing {
namespace {

/// Two keyframes that share twenty points; point n is feature n - 1 of both.
MapDelta two_keyframes() {
  MapDelta delta;
  for (std::uint64_t n = 1; n <= 20; ++n) delta.points.push_back(new_point(n));
  delta.keyframes = {new_keyframe(1, points_from(1, 20)), new_keyframe(2, points_from(1, 20))};
  return delta;
}

template <typename F>
auto on_point(const Map& map, std::uint64_t n, F&& f) {
  return map.read([&](const MapView& view) {
    const MapPoint* point = view.point(pt(n));
    EXPECT_NE(point, nullptr) << "point " << n;
    return f(point ? *point : MapPoint{});
  });
}

TEST(Commit, CountsWhatItDid) {
  Map map;
  const CommitReport first = map.commit(two_keyframes());
  EXPECT_EQ(first.applied, 22);
  EXPECT_EQ(first.stale + first.unknown, 0);
  const CommitReport again = map.commit(two_keyframes());
  EXPECT_EQ(again.applied + again.stale + again.unknown, 0);
}

TEST(Commit, StereoObservationsWeighTwice) {
  Map map;
  map.commit(two_keyframes());
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.weight; }), 4);  // feature 0 has depth
  EXPECT_EQ(on_point(map, 2, [](auto& p) { return p.weight; }), 2);  // feature 1 has none
}

TEST(Commit, OlderVersionsAreStale) {
  Map map;
  map.commit(two_keyframes());
  MapDelta newer;
  newer.positions = {{pt(1), {1, 2, 3}, 5}};
  newer.poses = {{kf(2), SE3(Eigen::Matrix3d::Identity(), {9, 9, 9}), 3}};
  EXPECT_EQ(map.commit(newer).applied, 2);
  MapDelta older;
  older.positions = {{pt(1), {0, 0, 0}, 4}};
  older.poses = {{kf(2), SE3(), 2}};
  const CommitReport report = map.commit(older);
  EXPECT_EQ(report.applied, 0);
  EXPECT_EQ(report.stale, 2);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.p_w.z(); }), 3);
  // Another module reached the same version with another value, so its value stays.
  older.positions = {{pt(1), {0, 0, 0}, 5}};
  older.poses.clear();
  EXPECT_EQ(map.commit(older).stale, 1);
}

TEST(Commit, EditsOfUnknownElementsAreCountedAndIgnored) {
  Map map;
  map.commit(two_keyframes());
  const std::string before = dump(map);
  MapDelta delta;
  delta.attach = {{kf(7), 0, pt(1)}, {kf(1), 39, pt(777)}, {kf(1), 4000, pt(1)}};
  delta.detach = {{kf(7), 0, pt(1)}};
  delta.fusions = {{pt(500), pt(1)}, {pt(1), pt(500)}};
  delta.positions = {{pt(500), {0, 0, 0}, 9}};
  delta.poses = {{kf(7), SE3(), 9}};
  delta.observation_counts = {{pt(500), 3, 3}};
  delta.culled_points = {pt(500)};
  delta.culled_keyframes = {kf(7)};
  delta.points = {new_point(0)};
  delta.points[0].id = {(std::uint64_t{9} << 56) | 1};  // no such IdSpace
  delta.points.push_back(delta.points[0]);
  delta.points[1].id = {kMobile | (std::uint64_t{1} << 50)};  // beyond kMaxSlots
  delta.keyframes = {new_keyframe(9, {})};
  delta.keyframes[0].points.resize(3);  // not one per feature
  const CommitReport report = map.commit(delta);
  EXPECT_EQ(report.applied, 0);
  EXPECT_EQ(report.unknown, 14);
  EXPECT_EQ(dump(map), before);
}

TEST(Commit, AttachReplacesWhatEitherSideHad) {
  Map map;
  map.commit(two_keyframes());
  MapDelta delta;
  delta.attach = {{kf(1), 4, pt(1)}};  // was feature 0; feature 4 saw point 5
  EXPECT_EQ(map.commit(delta).applied, 1);
  map.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe(kf(1))->points[4], pt(1));
    EXPECT_FALSE(view.keyframe(kf(1))->points[0]);
    EXPECT_EQ(view.point(pt(1))->observations.size(), 2u);
    EXPECT_EQ(view.point(pt(5)), nullptr);  // one stereo observation left: weight 2, culled
    return 0;
  });
}

TEST(Commit, PointThatLostObservationsIsCulledAtWeightTwo) {
  MapDelta delta = two_keyframes();
  delta.keyframes.push_back(new_keyframe(3, points_from(1, 20)));
  Map map;
  map.commit(delta);
  MapDelta detach;
  detach.detach = {{kf(3), 0, pt(1)}, {kf(3), 1, pt(2)}};
  map.commit(detach);
  map.read([](const MapView& view) {
    EXPECT_NE(view.point(pt(1)), nullptr);  // stereo: 6 -> 4
    EXPECT_EQ(view.point(pt(2)), nullptr);  // mono: 3 -> 2
    EXPECT_FALSE(view.keyframe(kf(1))->points[1]);
    EXPECT_FALSE(view.resolve(pt(2)));
    EXPECT_EQ(view.point_count(), 19u);
    return 0;
  });
  // A culled id cannot be used again.
  EXPECT_EQ(map.commit(two_keyframes()).unknown, 1);
}

TEST(Commit, FreshPointOfWeightTwoStays) {
  Map map;
  MapDelta delta;
  delta.points = {new_point(1)};
  delta.keyframes = {new_keyframe(1, {1})};
  map.commit(delta);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.weight; }), 2);
}

TEST(Commit, FusionMovesObservationsAndResolves) {
  MapDelta delta;
  for (std::uint64_t n = 1; n <= 3; ++n) delta.points.push_back(new_point(n));
  delta.keyframes = {new_keyframe(1, {1, 0, 2}), new_keyframe(2, {2}), new_keyframe(3, {1, 0, 3})};
  delta.observation_counts = {{pt(1), 10, 6}, {pt(2), 5, 4}};
  Map map;
  map.commit(delta);
  MapDelta fusion;
  fusion.fusions = {{pt(2), pt(1)}, {pt(1), pt(3)}};
  EXPECT_EQ(map.commit(fusion).applied, 2);
  map.read([](const MapView& view) {
    EXPECT_EQ(view.resolve(pt(2)), pt(3));
    EXPECT_EQ(view.resolve(pt(1)), pt(3));
    EXPECT_EQ(view.resolve(pt(3)), pt(3));
    EXPECT_EQ(view.point(pt(1)), nullptr);
    const MapPoint& survivor = *view.point(pt(3));
    EXPECT_EQ(survivor.observations.size(), 3u);
    EXPECT_EQ(survivor.weight, 6);
    EXPECT_EQ(survivor.visible, 16u);
    EXPECT_EQ(survivor.found, 11u);
    // Keyframe 1 saw both points, so one of its features is free now. Keyframe 3 keeps its feature.
    EXPECT_EQ(view.keyframe(kf(1))->points[0], pt(3));
    EXPECT_FALSE(view.keyframe(kf(1))->points[2]);
    EXPECT_EQ(view.keyframe(kf(3))->points[2], pt(3));
    EXPECT_FALSE(view.keyframe(kf(3))->points[0]);
    return 0;
  });
  EXPECT_EQ(map.commit(fusion).applied, 0);
}

TEST(Commit, NewKeyFrameMayNameAPointThatWasFused) {
  Map map;
  map.commit(two_keyframes());
  MapDelta fusion;
  fusion.fusions = {{pt(2), pt(1)}};
  map.commit(fusion);
  MapDelta late;
  late.keyframes = {new_keyframe(3, {2, 1, 0, 3})};
  map.commit(late);
  map.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe(kf(3))->points[0], pt(1));
    EXPECT_FALSE(view.keyframe(kf(3))->points[1]);  // the same point, already seen as feature 0
    EXPECT_EQ(view.keyframe(kf(3))->points[3], pt(3));
    return 0;
  });
}

TEST(Commit, AppearanceIsDerivedFromObservations) {
  Map map;
  map.commit(two_keyframes());
  map.read([](const MapView& view) {
    const MapPoint& point = *view.point(pt(1));
    const KeyFrame& first = *view.keyframe(kf(1));
    const KeyFrame& second = *view.keyframe(kf(2));
    EXPECT_EQ(point.appearance.descriptor, first.features->descriptor(0));
    const Eigen::Vector3d a = (point.p_w - first.T_cw.inverse().t).normalized();
    const Eigen::Vector3d b = (point.p_w - second.T_cw.inverse().t).normalized();
    EXPECT_LT((point.appearance.normal - (0.5 * (a + b)).cast<float>()).norm(), 1e-6f);
    const double distance = (point.p_w - first.T_cw.inverse().t).norm();
    const auto& pyramid = first.features->sensor().pyramid;
    const float expected =
        static_cast<float>(distance) * pyramid.scale[first.features->keypoint(0).octave];
    EXPECT_FLOAT_EQ(point.appearance.max_distance_m, expected);
    EXPECT_FLOAT_EQ(point.appearance.min_distance_m, expected / pyramid.scale.back());
    return 0;
  });
}

TEST(Commit, DescriptorIsTheOneClosestToTheOthers) {
  // Five observations: four random descriptors and their bit-wise majority.
  MapDelta delta;
  delta.points = {new_point(1)};
  Descriptor middle{};
  std::vector<Descriptor> seen;
  for (std::uint64_t n = 1; n <= 4; ++n)
    seen.push_back(make_features(40, static_cast<unsigned>(n))->descriptor(0));
  for (int w = 0; w < 4; ++w)
    middle[w] = (seen[0][w] & seen[1][w]) | (seen[2][w] & (seen[0][w] ^ seen[1][w]));
  for (std::uint64_t n = 1; n <= 5; ++n) {
    delta.keyframes.push_back(new_keyframe(n, {1}));
    if (n == 3) {
      std::vector<KeyPoint> keypoints(40);
      std::vector<Descriptor> descriptors(40, middle);
      delta.keyframes.back().features =
          std::make_shared<FeatureSet>(make_sensor(), keypoints, descriptors);
    }
  }
  Map map;
  map.commit(delta);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.appearance.descriptor; }), middle);
}

TEST(Commit, GivenAppearanceStaysUntilObservationsChange) {
  MapDelta delta = two_keyframes();
  delta.points[0].appearance.descriptor = {7, 7, 7, 7};
  delta.points[0].appearance.max_distance_m = 11;
  delta.points[0].appearance.min_distance_m = 1;
  Map map;
  map.commit(delta);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.appearance.descriptor[0]; }), 7u);
  MapDelta move;
  move.positions = {{pt(1), {0, 0, 3}, 1}};
  map.commit(move);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.appearance.descriptor[0]; }), 7u);
  MapDelta more;
  more.keyframes = {new_keyframe(3, {1})};
  map.commit(more);
  EXPECT_NE(on_point(map, 1, [](auto& p) { return p.appearance.descriptor[0]; }), 7u);
}

TEST(Commit, RangeOfAPointWhoseReferenceIsNotHereIsKept) {
  MapDelta delta = two_keyframes();
  delta.points[0].reference = kf(99);
  delta.points[0].appearance.max_distance_m = 11;
  delta.points[0].appearance.min_distance_m = 1;
  Map map;
  map.commit(delta);
  MapDelta more;
  more.keyframes = {new_keyframe(3, {1})};
  map.commit(more);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.appearance.max_distance_m; }), 11);
}

TEST(Commit, ObservationCountsOnlyGrowAndDoNotCountAsARevision) {
  Map map;
  map.commit(two_keyframes());
  const std::uint64_t revision = map.revision();
  MapDelta delta;
  delta.observation_counts = {{pt(1), 8, 4}};
  EXPECT_EQ(map.commit(delta).applied, 1);
  delta.observation_counts = {{pt(1), 6, 3}};
  EXPECT_EQ(map.commit(delta).applied, 0);
  EXPECT_EQ(on_point(map, 1, [](auto& p) { return p.visible * 100 + p.found; }), 804u);
  EXPECT_EQ(map.revision(), revision);
  delta = {};
  delta.positions = {{pt(1), {0, 0, 5}, 1}};
  map.commit(delta);
  EXPECT_GT(map.revision(), revision);
}

TEST(Commit, EpochIsTheHighestSeen) {
  Map map;
  MapDelta delta = two_keyframes();
  delta.epoch = 4;
  map.commit(delta);
  map.commit(MapDelta{});
  EXPECT_EQ(map.read([](const MapView& view) { return view.epoch(); }), 4u);
}

TEST(Commit, ClearFreesEverythingAndIdsCanGoOn) {
  Map map;
  MapDelta delta = two_keyframes();
  const std::weak_ptr<const FeatureSet> features = delta.keyframes[0].features;
  map.commit(delta);
  delta = {};
  map.clear();
  EXPECT_TRUE(features.expired());
  map.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe_count() + view.point_count(), 0u);
    EXPECT_TRUE(view.keyframe_ids().empty());
    EXPECT_FALSE(view.origin());
    EXPECT_FALSE(view.pose_of(kf(1)));
    return 0;
  });
  MapDelta next;
  next.points = {new_point(1000)};
  next.keyframes = {new_keyframe(500, {1000})};
  EXPECT_EQ(map.commit(next).applied, 2);
}

TEST(Commit, CulledKeyFrameIsReallyFreed) {
  Map map;
  MapDelta delta = two_keyframes();
  const std::weak_ptr<const FeatureSet> features = delta.keyframes[1].features;
  map.commit(delta);
  delta = {};
  delta.culled_keyframes = {kf(2)};
  map.commit(delta);
  EXPECT_TRUE(features.expired());
}

TEST(Commit, RolesDoNotCollide) {
  Map map;
  map.commit(two_keyframes());
  MapDelta delta;
  delta.points = {new_point(1)};
  delta.points[0].id = {kEdge | 1};
  delta.attach = {{kf(1), 30, {kEdge | 1}}};
  EXPECT_EQ(map.commit(delta).applied, 2);
  map.read([](const MapView& view) {
    EXPECT_EQ(view.point_ids().front(), pt(1));
    EXPECT_EQ(view.point_ids().back(), MapPointId{kEdge | 1});
    return 0;
  });
}

}  // namespace
}  // namespace slambed::testing
