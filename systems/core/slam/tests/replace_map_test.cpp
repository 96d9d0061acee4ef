// SPDX-License-Identifier: Apache-2.0
// Switching to another map: the effect of Edge-SLAM's update on a tracker during a walk.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "slam/local_mapper.hpp"
#include "slam/map_change.hpp"
#include "slam/tracker.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

/// The newest `keyframes` of a map with their points as a new map, moved by T_new_old.
std::shared_ptr<Map> excerpt(const Map& map, std::size_t keyframes, const SE3& T_new_old = {}) {
  MapDelta delta = map.read([&](const MapView& view) {
    MapDelta all;
    auto ids = view.keyframe_ids();
    if (ids.size() > keyframes) ids.erase(ids.begin(), ids.end() - keyframes);
    for (const MapPointId id : view.point_ids()) {
      const MapPoint& p = *view.point(id);
      all.points.push_back({id, T_new_old * p.p_w, p.appearance, p.reference, p.first_keyframe,
                            p.visible, p.found, p.version});
    }
    for (const KeyFrameId id : ids) {
      const KeyFrame& k = *view.keyframe(id);
      all.keyframes.push_back({id, k.frame_index, k.timestamp_s, k.features,
                               k.T_cw * T_new_old.inverse(), k.points, k.parent, k.version});
    }
    return all;
  });
  auto copy = std::make_shared<Map>();
  copy->commit(delta);
  return copy;
}

class ReplaceMap : public ::testing::Test {
 protected:
  ReplaceMap() : tracker({}, std::make_shared<Map>(), IdSpace::kTracker) {}

  TrackOutcome show(int i, bool keyframe = false) {
    const TrackOutcome outcome = tracker.track(i, i / 30.0, scene.look(walk(i)));
    if (keyframe || outcome.initialized_now) tracker.create_keyframe();
    return outcome;
  }
  void expect_tracked(int i, const SE3& T_new_old = {}) {
    const TrackOutcome outcome = show(i);
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_TRUE(outcome.by_motion_model) << "frame " << i;
    const SE3 truth = walk(i) * walk(0).inverse() * T_new_old.inverse();
    EXPECT_LT(center_error(outcome.T_cw, truth), 2e-3) << "frame " << i;
  }

  SyntheticScene scene;
  Tracker tracker;
};

const SE3 kMoved(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX()).toRotationMatrix(), {5, 1, -2});

TEST_F(ReplaceMap, SameKeyFramesInOtherCoordinates) {
  for (int i = 0; i < 40; ++i) show(i, i % 8 == 7);
  tracker.replace_map(excerpt(*tracker.map(), 99, kMoved));
  for (int i = 40; i < 50; ++i) expect_tracked(i, kMoved);
}

TEST_F(ReplaceMap, TheReferenceIsMissingButANeighborIsThere) {
  for (int i = 0; i < 33; ++i) show(i, i % 8 == 7);
  const auto older = excerpt(*tracker.map(), 3, kMoved);
  tracker.create_keyframe();  // becomes the reference, which the older copy lacks
  show(33);
  tracker.replace_map(older);
  for (int i = 34; i < 44; ++i) expect_tracked(i, kMoved);
}

/// The map with new point ids, in the edge's space.
std::shared_ptr<Map> renamed(const Map& map) {
  MapDelta delta = map.read([&](const MapView& view) {
    MapDelta all;
    const auto other = [](MapPointId id) {
      return id ? MapPointId{id.value + (std::uint64_t{1} << 56)} : id;
    };
    for (const MapPointId id : view.point_ids()) {
      const MapPoint& p = *view.point(id);
      all.points.push_back({other(id), p.p_w, p.appearance, p.reference, p.first_keyframe});
    }
    for (const KeyFrameId id : view.keyframe_ids()) {
      const KeyFrame& k = *view.keyframe(id);
      auto points = k.points;
      for (MapPointId& point : points) point = other(point);
      all.keyframes.push_back(
          {id, k.frame_index, k.timestamp_s, k.features, k.T_cw, points, k.parent, k.version});
    }
    return all;
  });
  auto fresh = std::make_shared<Map>();
  fresh->commit(delta);
  return fresh;
}

TEST_F(ReplaceMap, PointsFusedOverThereAreFoundThroughTheirFeatures) {
  for (int i = 0; i < 40; ++i) show(i, i % 8 == 7);
  tracker.replace_map(renamed(*tracker.map()));
  for (int i = 40; i < 50; ++i) expect_tracked(i);
}

/// Edge-SLAM's behaviors, one at a time.
class ReplaceMapAsEdgeSlam : public ReplaceMap {
 protected:
  void begin(const TrackerOptions& options) {
    tracker_.emplace(options, std::make_shared<Map>(), IdSpace::kTracker);
    for (int i = 0; i < 40; ++i) step(i, i % 8 == 7);
  }
  TrackOutcome step(int i, bool keyframe = false) {
    const TrackOutcome outcome = tracker_->track(i, i / 30.0, scene.look(walk(i)));
    if (keyframe || outcome.initialized_now) tracker_->create_keyframe();
    return outcome;
  }
  KeyFrameId newest() const {
    return tracker_->map()->read([](const MapView& view) { return view.keyframe_ids().back(); });
  }
  std::optional<Tracker> tracker_;
};

TEST_F(ReplaceMapAsEdgeSlam, PointsOfTheEdgeAreNotKnownAgain) {
  begin({.points_by_observation = false});
  tracker_->replace_map(renamed(*tracker_->map()));
  const TrackOutcome next = step(40);
  EXPECT_EQ(next.search.motion_matches, 0) << "the last frame knows none of them";
  EXPECT_FALSE(next.by_motion_model);
  EXPECT_EQ(next.state, TrackingState::kOk) << "the reference keyframe helps";
  // The tracker's own points keep their ids.
  begin({.points_by_observation = false});
  tracker_->replace_map(excerpt(*tracker_->map(), 99));
  EXPECT_TRUE(step(40).by_motion_model);
}

TEST_F(ReplaceMapAsEdgeSlam, PointsChangePlacesWhereTheyAreHandedOutByRank) {
  const MapPointId none;
  std::vector<MapPointId> points{none, {11}, {12}, none, {14}, {15}};
  hand_out_by_rank(points);
  EXPECT_EQ(points, (std::vector<MapPointId>{none, {12}, {14}, none, none, none}));

  begin({});
  tracker_->replace_map(excerpt(*tracker_->map(), 99));
  const auto own = step(40).search.motion_matches;
  begin({.points_by_rank = true});
  tracker_->replace_map(excerpt(*tracker_->map(), 99));
  const TrackOutcome next = step(40);
  ASSERT_TRUE(own && next.search.motion_matches);
  EXPECT_LT(*next.search.motion_matches, *own / 3);
  EXPECT_EQ(next.state, TrackingState::kOk) << "the reference keyframe helps";
}

TEST_F(ReplaceMapAsEdgeSlam, TheNewestKeyframeBecomesTheReference) {
  for (const bool newest_is_reference : {false, true}) {
    begin({.newest_is_reference = newest_is_reference});
    step(40);
    tracker_->create_keyframe(false);  // provisional, so no reference yet
    ASSERT_NE(tracker_->reference(), newest());
    tracker_->replace_map(excerpt(*tracker_->map(), 99, kMoved));
    EXPECT_EQ(tracker_->reference() == newest(), newest_is_reference);
    EXPECT_TRUE(step(41).by_motion_model) << "the last pose has moved with the map all the same";
  }
}

TEST_F(ReplaceMapAsEdgeSlam, TheLastPoseStaysUnlessItsReferenceIsTheNewest) {
  begin({.reanchor_last = false});
  step(40, true);  // its keyframe is the reference and the newest
  ASSERT_EQ(tracker_->reference(), newest());
  tracker_->replace_map(excerpt(*tracker_->map(), 99, kMoved));
  EXPECT_TRUE(step(41).by_motion_model);

  step(42);
  tracker_->create_keyframe(false);
  ASSERT_NE(tracker_->reference(), newest());
  tracker_->replace_map(excerpt(*tracker_->map(), 99, kMoved));
  EXPECT_FALSE(step(43).by_motion_model) << "where the map was before";
}

TEST_F(ReplaceMapAsEdgeSlam, NoKeyframeIsWantedForPointsThatOnlyTrackingHasSeen) {
  for (const bool observes_known : {true, false}) {
    tracker_.emplace(TrackerOptions{.observes_known = observes_known}, std::make_shared<Map>(),
                     IdSpace::kTracker);
    for (int i = 0; i < 25; ++i) {
      step(i);
      if (i % 8 == 7) tracker_->create_keyframe(false);
    }
    EXPECT_EQ(tracker_->evidence().keyframes, 4);
    EXPECT_EQ(tracker_->evidence().reference_matches > 0, observes_known);
    EXPECT_EQ(tracker_->state(), TrackingState::kOk);
  }
}

TEST_F(ReplaceMap, NothingInCommonMeansRelocalization) {
  for (int i = 0; i < 20; ++i) show(i, i % 8 == 7);
  Tracker other({}, std::make_shared<Map>(), IdSpace::kEdgeMapper);
  for (int i = 0; i < 30; ++i) {
    const auto outcome = other.track(i, i / 30.0, scene.look(walk(i)));
    if (outcome.initialized_now || i % 8 == 7) other.create_keyframe();
  }
  tracker.replace_map(other.map());
  int tracked = 0;
  for (int i = 20; i < 30; ++i) tracked += show(i).state == TrackingState::kOk;
  EXPECT_GE(tracked, 8);
}

TEST_F(ReplaceMap, AnEmptyMapMeansStartingOver) {
  for (int i = 0; i < 10; ++i) show(i);
  tracker.replace_map(std::make_shared<Map>());
  EXPECT_EQ(tracker.state(), TrackingState::kNotInitialized);
  EXPECT_TRUE(show(10).initialized_now);
}

TEST_F(ReplaceMap, AMapFromElsewhereBeforeTheFirstFrame) {
  Tracker other({}, std::make_shared<Map>(), IdSpace::kEdgeMapper);
  for (int i = 0; i < 60; ++i) {
    const auto outcome = other.track(i, i / 30.0, scene.look(walk(i)));
    if (outcome.initialized_now || i % 8 == 7) other.create_keyframe();
  }
  tracker.replace_map(other.map());
  EXPECT_EQ(tracker.state(), TrackingState::kLost);
  EXPECT_EQ(show(60).state, TrackingState::kOk);
}

TEST_F(ReplaceMap, AnotherTrackerAndMapperGoOnInAMapAndNameNothingAsItDoes) {
  const auto map = tracker.map();
  LocalMapper mapper({}, map, IdSpace::kMobileMapper);
  const auto work_in = [&](LocalMapper& by, const MapDelta& made) {
    by.insert(made.keyframes.at(0).id);
    const MapDelta triangulated = by.triangulate();
    map->commit(triangulated);
    return triangulated.points;
  };
  for (int i = 0; i < 60; ++i) {
    // Far points have no depth, so the mapper has something to triangulate.
    const auto features = scene.look(walk(i), {.depth_limit_m = 3});
    const bool first = tracker.track(i, i / 30.0, features).initialized_now;
    if (first || i % 8 == 7) work_in(mapper, tracker.create_keyframe());
  }
  const auto ids = [](const MapView& view) {
    return std::pair(view.keyframe_ids(), view.point_ids());
  };
  const auto [keyframes, points] = map->read(ids);
  const auto named = [](const auto& ascending, auto id) {
    return std::binary_search(ascending.begin(), ascending.end(), id);
  };

  Tracker next({}, map, IdSpace::kTracker);
  LocalMapper next_mapper({}, map, IdSpace::kMobileMapper);
  EXPECT_EQ(next.state(), TrackingState::kLost);
  std::size_t triangulated = 0;
  for (int i = 60; i < 90; ++i) {
    const auto outcome = next.track(i, i / 30.0, scene.look(walk(i), {.depth_limit_m = 3}));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << i;
    EXPECT_FALSE(outcome.initialized_now);
    EXPECT_LT(center_error(outcome.T_cw, walk(i) * walk(0).inverse()), 5e-3) << i;
    if (i % 8 != 7) continue;
    const MapDelta made = next.create_keyframe();
    EXPECT_FALSE(named(keyframes, made.keyframes.at(0).id));
    for (const NewPoint& point : made.points) EXPECT_FALSE(named(points, point.id));
    for (const NewPoint& point : work_in(next_mapper, made)) {
      EXPECT_FALSE(named(points, point.id));
      ++triangulated;
    }
  }
  EXPECT_GT(triangulated, 0u);
  const auto after = map->read(ids).first;
  EXPECT_TRUE(std::includes(after.begin(), after.end(), keyframes.begin(), keyframes.end()));
  EXPECT_EQ(after.size(), keyframes.size() + 4);
}

}  // namespace
}  // namespace slambed::testing
