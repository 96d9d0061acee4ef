// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "offload/downlink/update_rules.hpp"
#include "offload/maps/update_content.hpp"
#include "wire/tests/examples.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;
using wire::keyframe_id;

UpdateState usual() {
  return {
      .update = 5, .applied = 4, .local_keyframes = 12, .new_keyframe = true, .since_keyframe = 1s};
}

std::string reason(const UpdateRules& rules, const UpdateState& state) {
  const auto declined = update_decline_reason(rules, state);
  return declined ? std::string(*declined) : "welcome";
}

TEST(UpdateRules, FollowEdgeSlam) {
  const UpdateRules rules{.min_local_keyframes = 6, .fast_motion = 300ms};
  EXPECT_EQ(reason(rules, usual()), "welcome");
  auto state = usual();
  state.local_keyframes = 5;
  EXPECT_EQ(reason(rules, state), "few keyframes");
  state = usual();
  state.new_keyframe = false;
  EXPECT_EQ(reason(rules, state), "up to date");
  state = usual();
  state.applied = 5;
  EXPECT_EQ(reason(rules, state), "older than the map");
  state = usual();
  state.former_edge = true;
  EXPECT_EQ(reason(rules, state), "its edge is gone");
  state = usual();
  state.before_recovery = true;
  EXPECT_EQ(reason(rules, state), "from before the recovery");
  EXPECT_EQ(obsolete_reason(state), "from before the recovery");
  EXPECT_TRUE(keeps_poses(state));
  state = usual();
  state.older_than_deferred_keyframes = true;
  EXPECT_EQ(reason(rules, state), "the edge catches up");
  state.relocalization = state.lost = true;
  EXPECT_EQ(reason(rules, state), "welcome");
}

TEST(UpdateRules, FastMotionMattersLessTheMoreKeyframesThereAre) {
  const UpdateRules rules{.min_local_keyframes = 1, .fast_motion = 300ms};
  auto state = usual();  // 12 local keyframes: 300 / 3 = 100 ms
  state.since_keyframe = 99ms;
  EXPECT_EQ(reason(rules, state), "fast motion");
  state.since_keyframe = 100ms;
  EXPECT_EQ(reason(rules, state), "welcome");
  state.since_keyframe = 0ms;
  state.local_keyframes = 36;  // 300 / 7 < 50 ms
  EXPECT_EQ(reason(rules, state), "welcome");
  state.local_keyframes = 2;  // an update has shrunk the local map
  EXPECT_EQ(reason(rules, state), "fast motion");
  state.since_keyframe = 299ms;
  EXPECT_EQ(reason(rules, state), "fast motion");
  state.local_keyframes = 1;
  EXPECT_EQ(reason({.min_local_keyframes = 1, .fast_motion = 0ms}, state), "welcome");
}

TEST(UpdateRules, OfALocalMapOfOneEachKeyframeIsAStep) {
  const UpdateRules rules{.min_local_keyframes = 1, .fast_motion = 300ms, .local_map_size = 1};
  auto state = usual();
  state.local_keyframes = 2;  // 300 / 3
  state.since_keyframe = 99ms;
  EXPECT_EQ(reason(rules, state), "fast motion");
  state.since_keyframe = 100ms;
  EXPECT_EQ(reason(rules, state), "welcome");
  state.since_keyframe = 0ms;
  state.local_keyframes = 6;  // 300 / 7 < 50 ms
  EXPECT_EQ(reason(rules, state), "welcome");
}

TEST(UpdateRules, ManyKeyframesPerSecondAreAReasonOfTheirOwn) {
  const UpdateRules rules{.min_local_keyframes = 1, .keyframe_rate_hz = 3};
  auto state = usual();
  state.since_keyframe = 0ms;
  state.keyframes_in_window = 3;
  EXPECT_EQ(reason(rules, state), "welcome");
  state.keyframes_in_window = 4;
  EXPECT_EQ(reason(rules, state), "many keyframes");
  EXPECT_EQ(reason({.min_local_keyframes = 1}, state), "welcome");
  state.relocalization = state.lost = true;
  EXPECT_EQ(reason(rules, state), "welcome");
}

TEST(UpdateRules, ARelocalizationMapIsForTheLostOnly) {
  const UpdateRules rules{.min_local_keyframes = 6, .fast_motion = 300ms};
  auto state = usual();
  state.relocalization = true;
  EXPECT_EQ(reason(rules, state), "not lost any more");
  state.lost = true;
  state.local_keyframes = 0;
  state.new_keyframe = false;
  EXPECT_EQ(reason(rules, state), "welcome");
}

/// Keyframes 1 to n, each sharing some points with the next.
void fill(Map& map, int keyframes) {
  std::mt19937 random(1);
  const auto sensor = wire::example_camera().make_sensor();
  std::vector<MapPointId> before;
  for (int k = 1; k <= keyframes; ++k) {
    MapDelta delta = wire::example_keyframe(random, sensor, 100, 0, 50);
    NewKeyFrame& keyframe = delta.keyframes[0];
    keyframe.id = keyframe_id(static_cast<std::uint64_t>(k));
    keyframe.parent = {};
    keyframe.points.assign(100, {});
    for (std::size_t i = 0; i < before.size(); ++i) keyframe.points[i] = before[i];
    before.clear();
    for (std::size_t i = 0; i < delta.points.size(); ++i) {
      NewPoint& point = delta.points[i];
      point.id = wire::point_id(static_cast<std::uint64_t>(k) * 1000 + i);
      point.reference = point.first_keyframe = keyframe.id;
      keyframe.points[50 + i] = point.id;
      before.push_back(point.id);
    }
    map.commit(delta);
  }
}

TEST(UpdateContent, IsAMapOfItsOwn) {
  Map map;
  fill(map, 4);
  const std::vector<KeyFrameId> wanted = {keyframe_id(3), keyframe_id(4), keyframe_id(77)};
  const MapDelta update =
      map.read([&](const MapView& view) { return extract_keyframes(view, wanted); });
  ASSERT_EQ(update.keyframes.size(), 2u);
  EXPECT_EQ(update.points.size(), 150u);  // points of 2 and 3 seen by 3, and those of 4
  Map local;
  const CommitReport report = local.commit(update);
  EXPECT_EQ(report.unknown, 0);
  local.read([&](const MapView& copy) {
    map.read([&](const MapView& original) {
      for (const KeyFrameId id : {keyframe_id(3), keyframe_id(4)}) {
        EXPECT_EQ(copy.keyframe(id)->points, original.keyframe(id)->points);
        EXPECT_EQ(copy.keyframe(id)->version, original.keyframe(id)->version);
      }
      for (const NewPoint& point : update.points) {
        EXPECT_EQ(copy.point(point.id)->p_w, original.point(point.id)->p_w);
      }
      return 0;
    });
    EXPECT_FALSE(copy.keyframe(keyframe_id(3))->covisibles.empty());
    return 0;
  });
}

TEST(UpdateContent, CovisiblesJoinOnce) {
  Map map;
  fill(map, 4);
  const auto joined = map.read([&](const MapView& view) {
    return with_covisibles(view, {keyframe_id(3), keyframe_id(2), keyframe_id(99)}, 5);
  });
  EXPECT_EQ(joined, (std::vector<KeyFrameId>{keyframe_id(3), keyframe_id(2), keyframe_id(99),
                                             keyframe_id(4), keyframe_id(1)}));
}

}  // namespace
}  // namespace slambed
