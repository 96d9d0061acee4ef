// SPDX-License-Identifier: Apache-2.0
// Each stage of local mapping on a map with known ground truth.
#include "slam/local_mapper.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>

#include "geometry/tests/draws.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

constexpr std::uint64_t kMobile = std::uint64_t{1} << 56;
KeyFrameId kf(std::uint64_t n) { return {kMobile | n}; }
MapPointId pt(std::uint64_t n) { return {kMobile | n}; }

/// Builds maps keyframe by keyframe in true world coordinates.
class MapperTest : public ::testing::Test {
 protected:
  /// Adds a keyframe at the frame's true pose. Features whose thing satisfies known(thing) are
  /// matched to that thing's point, which is made at its true position if new.
  template <typename Predicate>
  KeyFrameId add(int frame, Predicate&& known, const Seeing& view = {}) {
    MapDelta delta;
    NewKeyFrame keyframe;
    keyframe.id = kf(++keyframes_);
    keyframe.features = scene.look(walk(frame), view, 600);
    keyframe.T_cw = walk(frame);
    keyframe.points.resize(keyframe.features->size());
    things_[keyframe.id] = scene.seen();
    for (std::size_t i = 0; i < scene.seen().size(); ++i) {
      const int thing = scene.seen()[i];
      if (!known(thing)) continue;
      auto [place, fresh] = point_of_.try_emplace(thing);
      if (fresh) {
        place->second = pt(++points_);
        NewPoint point;
        point.id = place->second;
        point.p_w = scene.point(thing);
        point.reference = point.first_keyframe = keyframe.id;
        delta.points.push_back(point);
      }
      keyframe.points[i] = place->second;
    }
    delta.keyframes.push_back(keyframe);
    map->commit(delta);
    mapper.insert(keyframe.id);
    return keyframe.id;
  }
  int thing(KeyFrameId keyframe, int feature) { return things_[keyframe][feature]; }

  SyntheticScene scene;
  std::shared_ptr<Map> map = std::make_shared<Map>();
  LocalMapper mapper{{}, map, IdSpace::kEdgeMapper};
  std::map<int, MapPointId> point_of_;
  std::map<KeyFrameId, std::vector<int>> things_;
  std::uint64_t keyframes_ = 0, points_ = 0;
};

constexpr auto all = [](int) { return true; };

TEST_F(MapperTest, StagesDoNotCommit) {
  for (int i = 0; i < 4; ++i) add(i * 15, [](int t) { return t % 3 != 0; }, {.pixel_noise = 0.5});
  const std::uint64_t revision = map->revision();
  mapper.cull_points();
  EXPECT_FALSE(mapper.triangulate().points.empty());
  mapper.fuse();
  ASSERT_TRUE(mapper.begin_bundle());
  while (mapper.step_bundle()) {
  }
  EXPECT_FALSE(mapper.finish_bundle().positions.empty());
  mapper.cull_keyframes();
  EXPECT_EQ(map->revision(), revision);
}

TEST_F(MapperTest, TriangulatesUnmatchedFeaturesWhereTheyAre) {
  // No depth at all: everything must come from parallax.
  const Seeing mono{.pixel_noise = 0.3, .flipped_bits = 10, .depth_limit_m = 0};
  const auto half = [](int t) { return t % 2 == 0; };
  const KeyFrameId a = add(0, half, mono);
  const KeyFrameId b = add(30, half, mono);
  const MapDelta delta = mapper.triangulate();
  ASSERT_GT(delta.points.size(), 80u);
  EXPECT_EQ(delta.attach.size(), 2 * delta.points.size());
  int wrong = 0;
  for (std::size_t i = 0; i < delta.points.size(); ++i) {
    const ObservationEdit& in_b = delta.attach[2 * i];
    const ObservationEdit& in_a = delta.attach[2 * i + 1];
    EXPECT_EQ(in_b.keyframe, b);
    EXPECT_EQ(in_a.keyframe, a);
    EXPECT_EQ(in_a.point, delta.points[i].id);
    const int thing_a = thing(a, in_a.feature);
    EXPECT_NE(thing_a % 2, 0) << "had a point already";
    wrong += thing_a != thing(b, in_b.feature);
    if (thing_a == thing(b, in_b.feature)) {
      const double depth_m = (walk(30) * delta.points[i].p_w).z();
      EXPECT_LT((delta.points[i].p_w - scene.point(thing_a)).norm(), 0.05 * depth_m * depth_m);
    }
  }
  EXPECT_LE(wrong, 2);
  EXPECT_EQ(map->commit(delta).unknown, 0);
  map->read([&](const MapView& view) {
    const MapPoint& point = *view.point(delta.points[0].id);
    EXPECT_EQ(point.observations.size(), 2u);
    EXPECT_GT(point.appearance.max_distance_m, 0);
    EXPECT_EQ(point.id.value >> 56, 2u) << "made by the edge";
    return 0;
  });
  EXPECT_TRUE(mapper.triangulate().points.empty()) << "nothing is left to match";
}

TEST_F(MapperTest, NoTriangulationFromTheSamePlace) {
  const auto half = [](int t) { return t % 2 == 0; };
  add(0, half);
  add(0, half);
  EXPECT_TRUE(mapper.triangulate().points.empty());
}

TEST_F(MapperTest, AgesByIdCountKeyframesThatNeverCame) {
  LocalMapper by_id({.ages_by_id = true, .bundle = {}}, map, IdSpace::kEdgeMapper);
  const auto insert = [&](KeyFrameId id) {
    by_id.insert(id);
    return id;
  };
  const auto even = [](int t) { return t % 2 == 0; };
  insert(add(0, even));
  keyframes_ += 2;  // were made but dropped on the way
  insert(add(60, [](int) { return false; }));
  // One keyframe later the points are too young by keyframes mapped, but old enough by ids.
  EXPECT_TRUE(mapper.cull_points().culled_points.empty());
  EXPECT_FALSE(by_id.cull_points().culled_points.empty());
}

TEST_F(MapperTest, FusesPointsThatAreTheSameThing) {
  add(0, all, {.flipped_bits = 8});
  const auto first_points = point_of_;
  // The second keyframe has new points for a third of the things and none for another third.
  for (auto it = point_of_.begin(); it != point_of_.end();)
    it = it->first % 3 == 0 ? point_of_.erase(it) : std::next(it);
  add(10, [&](int t) { return t % 3 != 1; }, {.flipped_bits = 8});
  const MapDelta delta = mapper.fuse();
  EXPECT_GT(delta.fusions.size(), 100u);
  EXPECT_GT(delta.attach.size(), 100u);
  std::map<MapPointId, int> thing_of;
  for (const auto& [t, id] : first_points) thing_of[id] = t;
  for (const auto& [t, id] : point_of_) thing_of[id] = t;
  int wrong = 0;
  for (const PointFusion& fusion : delta.fusions)
    wrong += thing_of.at(fusion.gone) != thing_of.at(fusion.survivor);
  for (const ObservationEdit& edit : delta.attach)
    wrong += thing_of.at(edit.point) != thing(edit.keyframe, edit.feature);
  EXPECT_LE(wrong, 2);
  const CommitReport report = map->commit(delta);
  EXPECT_EQ(report.unknown, 0);
  const MapDelta again = mapper.fuse();
  EXPECT_LT(again.fusions.size() + again.attach.size(), 5u) << "done is done";
}

TEST_F(MapperTest, BundleMovesPointsAndPosesToTheTruth) {
  for (int i = 0; i < 5; ++i) add(i * 12, all, {.pixel_noise = 0.2});
  // Perturbs everything but the origin.
  std::mt19937 random(3);
  std::normal_distribution<double> noise;
  const MapDelta shake = map->read([&](const MapView& view) {
    MapDelta delta;
    for (const MapPointId id : view.point_ids())
      delta.positions.push_back(
          {id, view.point(id)->p_w + 0.02 * drawn<3>([&] { return noise(random); }), 4});
    for (const KeyFrameId id : view.keyframe_ids()) {
      if (id == view.origin()) continue;
      SE3 T_cw = view.keyframe(id)->T_cw;
      T_cw.t += 0.03 * drawn<3>([&] { return noise(random); });
      delta.poses.push_back({id, T_cw, 2});
    }
    return delta;
  });
  map->commit(shake);
  ASSERT_TRUE(mapper.begin_bundle());
  while (mapper.step_bundle()) {
  }
  const MapDelta delta = mapper.finish_bundle();
  for (const KeyFramePose& pose : delta.poses) {
    EXPECT_NE(pose.id, kf(1)) << "the origin is fixed";
    EXPECT_EQ(pose.version, 3u);
  }
  for (const PointPosition& position : delta.positions) EXPECT_EQ(position.version, 5u);
  EXPECT_EQ(map->commit(delta).stale, 0);
  map->read([&](const MapView& view) {
    for (int i = 0; i < 5; ++i)
      EXPECT_LT(center_error(view.keyframe(kf(i + 1))->T_cw, walk(i * 12)), 3e-3) << i;
    return 0;
  });
  EXPECT_TRUE(mapper.finish_bundle().empty()) << "handed out only once";
}

TEST_F(MapperTest, ABundleOfAGivenSizeHasTheBestCovisiblesOnly) {
  constexpr std::size_t kMoving = 3, kFixed = 2;
  LocalMapper whole({}, map, IdSpace::kEdgeMapper);
  LocalMapper small({.bundle = {}, .bundle_size = BundleLimits::Size{kMoving, kFixed}}, map,
                    IdSpace::kEdgeMapper);
  KeyFrameId last{};
  for (int i = 0; i < 12; ++i) last = add(i * 4, all, {.pixel_noise = 0.3});
  std::vector<KeyFrameId> moving{last}, part{last};
  map->read([&](const MapView& view) {
    const auto& covisibles = view.keyframe(last)->covisibles;
    EXPECT_GT(covisibles.size(), kMoving + kFixed);
    for (std::size_t n = 0; n < std::min(kMoving + kFixed, covisibles.size()); ++n) {
      if (n < kMoving) moving.push_back(covisibles[n].id);
      part.push_back(covisibles[n].id);
    }
    return 0;
  });
  const auto bundle = [&](LocalMapper& one) {
    one.insert(last);
    EXPECT_TRUE(one.begin_bundle());
    const std::size_t observations = one.bundle_observations();
    while (one.step_bundle()) {
    }
    return std::make_pair(observations, one.finish_bundle());
  };
  const auto [all_observations, all_moved] = bundle(whole);
  const auto [observations, moved] = bundle(small);
  EXPECT_LT(observations, all_observations);
  EXPECT_GT(all_moved.poses.size(), kMoving + 1);
  std::vector<KeyFrameId> ids;
  for (const KeyFramePose& pose : moved.poses) {
    ids.push_back(pose.id);
    map->read([&](const MapView& view) {
      EXPECT_LT(center_error(pose.T_cw, view.keyframe(pose.id)->T_cw), 5e-3);
      return 0;
    });
  }
  std::sort(moving.begin(), moving.end(), std::greater<>());
  std::erase(moving, kf(1));  // the origin is fixed in any bundle
  EXPECT_EQ(ids, moving);
  for (const ObservationEdit& edit : moved.detach)
    EXPECT_NE(std::find(part.begin(), part.end(), edit.keyframe), part.end());
}

TEST_F(MapperTest, BundleDetachesWrongMatches) {
  for (int i = 0; i < 5; ++i) add(i * 12, all, {.pixel_noise = 0.3});
  add(60, all, {.pixel_noise = 0.3, .wrong_share = 0.05});
  ASSERT_TRUE(mapper.begin_bundle());
  while (mapper.step_bundle()) {
  }
  const MapDelta delta = mapper.finish_bundle();
  int in_last = 0, elsewhere = 0;
  for (const ObservationEdit& edit : delta.detach) {
    in_last += edit.keyframe == kf(6);
    elsewhere += edit.keyframe != kf(6);
  }
  EXPECT_GT(in_last, 15);
  EXPECT_LT(elsewhere, in_last / 3);
}

TEST_F(MapperTest, ABundleCutInItsRobustStageChangesNothingLaterItGivesWhatItHas) {
  for (int i = 0; i < 4; ++i) add(i * 12, all, {.pixel_noise = 0.5});
  ASSERT_TRUE(mapper.begin_bundle());
  EXPECT_TRUE(mapper.finish_bundle().empty()) << "not a single step";
  ASSERT_TRUE(mapper.begin_bundle());
  mapper.step_bundle();
  EXPECT_TRUE(mapper.finish_bundle().empty()) << "half-solved";
  ASSERT_TRUE(mapper.begin_bundle());
  for (int step = 0; step < BundleOptions().robust_iterations; ++step) mapper.step_bundle();
  EXPECT_FALSE(mapper.finish_bundle().positions.empty());
}

TEST_F(MapperTest, ResultsThatCameTooLateAreStale) {
  for (int i = 0; i < 4; ++i) add(i * 12, all, {.pixel_noise = 0.5});
  ASSERT_TRUE(mapper.begin_bundle());
  while (mapper.step_bundle()) {
  }
  MapDelta meanwhile;
  meanwhile.poses = {{kf(2), SE3(), 1}};
  map->commit(meanwhile);
  const CommitReport report = map->commit(mapper.finish_bundle());
  EXPECT_EQ(report.stale, 1);
  EXPECT_TRUE(map->read([](const MapView& v) { return v.keyframe(kf(2))->T_cw.t.isZero(); }));
}

TEST_F(MapperTest, TwoKeyFramesAreNotWorthABundle) {
  add(0, all);
  add(10, all);
  EXPECT_FALSE(mapper.begin_bundle());
  EXPECT_FALSE(mapper.step_bundle());
  EXPECT_TRUE(mapper.finish_bundle().empty());
}

TEST_F(MapperTest, RedundantKeyFramesAreCulled) {
  for (int i = 0; i < 6; ++i) add(i, all);  // all see the same points
  const MapDelta delta = mapper.cull_keyframes();
  for (const KeyFrameId id : delta.culled_keyframes) {
    EXPECT_NE(id, kf(1)) << "the origin stays";
    EXPECT_NE(id, kf(6)) << "the newest stays";
  }
  // Every point must keep three observers besides the culled keyframe.
  EXPECT_EQ(delta.culled_keyframes.size(), 2u);
  map->commit(delta);
  EXPECT_TRUE(mapper.cull_keyframes().culled_keyframes.empty());
}

TEST_F(MapperTest, PointsThatAreNotFoundOrNotSeenAgainAreCulled) {
  add(0, all);
  EXPECT_TRUE(mapper.cull_points().empty());
  const MapPointId hardly_found = point_of_.begin()->second;
  MapDelta observation_counts;
  observation_counts.observation_counts = {{hardly_found, 9, 2}};
  map->commit(observation_counts);
  MapDelta delta = mapper.cull_points();
  ASSERT_EQ(delta.culled_points.size(), 1u);
  EXPECT_EQ(delta.culled_points[0], hardly_found);
  map->commit(delta);
  EXPECT_TRUE(mapper.cull_points().empty());

  // Two keyframes later, points with a single stereo observation are culled.
  const auto few = [](int t) { return t % 2 == 0; };
  add(8, few);
  EXPECT_TRUE(mapper.cull_points().empty());
  add(12, few);
  delta = mapper.cull_points();
  EXPECT_GT(delta.culled_points.size(), 100u);
  map->read([&](const MapView& view) {
    for (const MapPointId id : delta.culled_points) EXPECT_LE(view.point(id)->weight, 3);
    return 0;
  });
  map->commit(delta);
  // Points that passed stay after the third keyframe, whatever happens later.
  add(16, few);
  mapper.cull_points();
  const MapPointId old = map->read([](const MapView& view) { return view.point_ids().front(); });
  MapDelta late;
  late.observation_counts = {{old, 1000, 1}};
  map->commit(late);
  EXPECT_TRUE(mapper.cull_points().empty());
}

TEST_F(MapperTest, NothingHappensOnAMapThatWasCleared) {
  for (int i = 0; i < 4; ++i) add(i * 10, all);
  ASSERT_TRUE(mapper.begin_bundle());
  map->clear();
  mapper.step_bundle();
  EXPECT_EQ(map->commit(mapper.finish_bundle()).applied, 0);
  EXPECT_TRUE(mapper.cull_points().empty());
  EXPECT_TRUE(mapper.triangulate().empty());
  EXPECT_TRUE(mapper.fuse().empty());
  EXPECT_FALSE(mapper.begin_bundle());
  EXPECT_TRUE(mapper.cull_keyframes().empty());
}

TEST_F(MapperTest, ReplaceMapDropsPendingWork) {
  for (int i = 0; i < 4; ++i) add(i * 10, all);
  ASSERT_TRUE(mapper.begin_bundle());
  mapper.replace_map(std::make_shared<Map>());
  EXPECT_FALSE(mapper.step_bundle());
  EXPECT_TRUE(mapper.finish_bundle().empty());
  EXPECT_TRUE(mapper.triangulate().empty());
}

}  // namespace
}  // namespace slambed::testing
