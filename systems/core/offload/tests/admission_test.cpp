// SPDX-License-Identifier: Apache-2.0
#include "offload/uplink/admission.hpp"

#include <gtest/gtest.h>

#include "wire/tests/examples.hpp"

namespace slambed {
namespace {

using wire::keyframe_id;
using wire::point_id;

class Admission : public ::testing::Test {
 protected:
  Admission() {
    std::mt19937 random(1);
    message.delta =
        wire::example_keyframe(random, wire::example_camera().make_sensor(), 40, 10, 10);
    message.keyframe = message.delta.keyframes[0].id;
    message.delta.keyframes[0].timestamp_s = 10;
    state.keyframes = 20;
    state.played_fps = 10;
    state.last_accepted_s = 9.5;
    state.mapper = {.idle = false, .queued = 0, .accepts = true};
  }
  std::string reason() const {
    const auto declined = keyframe_decline_reason(message, state);
    return declined ? std::string(*declined) : "welcome";
  }
  wire::KeyFrameMessage message;
  AdmissionState state;
};

TEST_F(Admission, TheFirstKeyframeIsWelcomeAndNothingBeforeIt) {
  state.last_accepted_s = -1;
  EXPECT_EQ(reason(), "welcome") << "the map began with a stored one";
  state.keyframes = 0;
  EXPECT_EQ(reason(), "not the first keyframe");
  message.whole = true;
  EXPECT_EQ(reason(), "welcome");
  message.whole = false;
  message.first = true;
  EXPECT_EQ(reason(), "welcome");
  state.last_accepted_s = 5;  // the mobile starts a new map
  EXPECT_EQ(reason(), "welcome");
  state.last_accepted_s = 50;  // the edge got keyframes by a hand-over meanwhile
  EXPECT_EQ(reason(), "older than the last accepted");
}

TEST_F(Admission, AnOrdinaryKeyframeNeedsAnIdleMapperOrASecond) {
  EXPECT_EQ(reason(), "mapper busy");
  state.mapper.idle = true;
  EXPECT_EQ(reason(), "welcome");
  state.mapper.idle = false;
  state.last_accepted_s = 9.0;  // ten frames at ten per second
  EXPECT_EQ(reason(), "welcome");
}

TEST_F(Admission, MoreFramesBetweenKeyframesMeanALongerWait) {
  state.max_frames = 30;  // three seconds at ten per second
  state.last_accepted_s = 8.0;
  EXPECT_EQ(reason(), "mapper busy");
  state.last_accepted_s = 7.0;
  EXPECT_EQ(reason(), "welcome");
}

TEST_F(Admission, AnUrgentOneOnlyNeedsRoomInTheQueue) {
  message.urgent = true;
  EXPECT_EQ(reason(), "welcome");
  state.mapper.queued = 2;
  EXPECT_EQ(reason(), "welcome");
  state.mapper.queued = 3;
  EXPECT_EQ(reason(), "queue full");
}

TEST_F(Admission, OldOnesStoppedMappersAndFreshRelocalizationsAreDeclined) {
  state.mapper.idle = true;
  state.last_accepted_s = 10;
  EXPECT_EQ(reason(), "older than the last accepted");
  state.last_accepted_s = 9.5;
  message.after_relocalization = true;
  EXPECT_EQ(reason(), "just relocalized");
  state.keyframes = 10;  // a young map takes every keyframe
  EXPECT_EQ(reason(), "welcome");
  state.mapper.accepts = false;
  EXPECT_EQ(reason(), "mapper stopped");
}

TEST(RebaseKeyframe, FollowsFusionsForgetsCulledPointsAndKeepsEachPointOnce) {
  std::mt19937 random(2);
  const auto sensor = wire::example_camera().make_sensor();
  Map map;
  MapDelta base = wire::example_keyframe(random, sensor, 30, 0, 12);
  base.keyframes[0].id = keyframe_id(1);
  base.keyframes[0].parent = {};
  for (NewPoint& point : base.points) point.reference = point.first_keyframe = keyframe_id(1);
  map.commit(base);
  const auto known = [&](std::size_t i) { return base.points[i].id; };
  MapDelta edits;
  edits.fusions = {{known(0), known(1)}};
  edits.culled_points = {known(2)};
  map.commit(edits);

  MapDelta delta = wire::example_keyframe(random, sensor, 30, 0, 0 + 2);
  NewKeyFrame& keyframe = delta.keyframes[0];
  keyframe.parent = keyframe_id(33);  // unknown to this map
  delta.points[0].id = point_id(20'000);
  delta.points[1].id = point_id(20'001);
  const std::vector<MapPointId> fresh = {point_id(20'000), point_id(20'001)};
  for (auto& id : keyframe.points) id = {};
  keyframe.points[0] = known(0);  // fused into known(1)
  keyframe.points[1] = known(1);  // therefore the same point twice
  keyframe.points[2] = known(2);  // culled
  keyframe.points[3] = known(3);
  keyframe.points[4] = fresh[0];
  keyframe.points[5] = point_id(4'000'000);  // never received
  const MapDelta rebased =
      map.read([&](const MapView& view) { return rebase_keyframe(view, delta); });
  const auto& points = rebased.keyframes[0].points;
  EXPECT_EQ(points[0], known(1));
  EXPECT_FALSE(points[1]);
  EXPECT_FALSE(points[2]);
  EXPECT_EQ(points[3], known(3));
  EXPECT_EQ(points[4], fresh[0]);
  EXPECT_FALSE(points[5]);
  EXPECT_FALSE(rebased.keyframes[0].parent);
  ASSERT_EQ(rebased.points.size(), 1u);  // no keyframe sees fresh[1]
  EXPECT_EQ(rebased.points[0].id, fresh[0]);
}

}  // namespace
}  // namespace slambed
