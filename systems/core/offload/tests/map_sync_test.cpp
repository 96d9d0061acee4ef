// SPDX-License-Identifier: Apache-2.0
// Two equal maps change independently; the changes of one are merged into the other.
#include "offload/maps/map_sync.hpp"

#include <gtest/gtest.h>

#include <set>

#include "map/map_snapshot.hpp"
#include "map/tests/busy_writer.hpp"
#include "map/tests/map_fixture.hpp"

namespace slambed {
namespace {

using testing::kf;
using testing::pt;

class MapSync : public ::testing::Test {
 protected:
  MapSync() {
    MapDelta delta;
    for (std::uint64_t n = 1; n <= 30; ++n) delta.points.push_back(testing::new_point(n));
    delta.keyframes = {testing::new_keyframe(1, testing::points_from(1, 30)),
                       testing::new_keyframe(2, testing::points_from(1, 30)),
                       testing::new_keyframe(3, testing::points_from(1, 30))};
    mobile.commit(delta);
    edge.commit(delta);
    base = mobile.read(snapshot);
  }
  MapDelta changes() const { return changes_since(base, copy_of(mobile, base)); }
  CommitReport hand_over() {
    const MapDelta delta = changes();
    return edge.commit(edge.read([&](const MapView& view) { return rebase_changes(view, delta); }));
  }
  static SE3 at(double x) {
    SE3 pose;
    pose.t = {x, 0, 0};
    return pose;
  }
  Map mobile, edge;
  MapDelta base;
};

TEST_F(MapSync, TheMapMayBeWorkedAtWhileItsCopiesAreCompared) {
  // The writer always moves two points together.
  testing::BusyWriter writer(mobile, [](std::uint32_t number) {
    MapDelta delta;
    const Eigen::Vector3d place(number, 0, 2);
    delta.positions = {{pt(1), place, number}, {pt(30), place, number}};
    return delta;
  });
  int compared = 0;
  EXPECT_TRUE(testing::BusyWriter::until([&] {
    const MapCopy copy = copy_of(mobile, base);
    const int then = writer.commits();
    if (!testing::BusyWriter::until([&] { return writer.commits() > then + 1; })) return false;
    const MapDelta delta = changes_since(base, copy);  // as of the copy, not of now
    if (delta.positions.size() != 2) return false;     // the writer had not begun
    EXPECT_EQ(delta.positions[0].p_w.x(), delta.positions[1].p_w.x());
    EXPECT_LE(delta.positions[0].version, static_cast<std::uint32_t>(then) + 1);
    return ++compared >= 20;
  }));
}

TEST_F(MapSync, NothingHasChangedAtFirst) { EXPECT_TRUE(changes().empty()); }

TEST_F(MapSync, AllKindsOfChangesMakeTheSameMap) {
  MapDelta delta;
  delta.points = {testing::new_point(40, {1, 1, 4})};
  auto seen = testing::points_from(1, 30);
  seen.push_back(40);
  delta.keyframes = {testing::new_keyframe(4, seen)};
  delta.attach = {{kf(2), 35, pt(40)}};
  delta.detach = {{kf(3), 9, pt(10)}};
  delta.fusions = {{pt(20), pt(21)}};
  delta.positions = {{pt(5), {0, 1, 3}, 1}};
  delta.poses = {{kf(2), at(0.25), 1}};
  delta.culled_points = {pt(30)};
  mobile.commit(delta);
  const CommitReport report = hand_over();
  EXPECT_EQ(report.stale, 0);
  EXPECT_EQ(testing::dump(edge), testing::dump(mobile));
  hand_over();  // a second time changes only versions of what moved
  EXPECT_EQ(edge.read([](const MapView& view) { return view.keyframe(kf(2))->T_cw.t.x(); }), 0.25);
}

TEST_F(MapSync, AKeyframeThatWasCulledGoesOnTheOtherSideToo) {
  MapDelta delta;
  delta.culled_keyframes = {kf(2)};
  mobile.commit(delta);
  hand_over();
  edge.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe(kf(2)), nullptr);
    EXPECT_TRUE(view.pose_of(kf(2)));
    return 0;
  });
}

TEST_F(MapSync, TheChangesWinOverWhatWasMovedThere) {
  MapDelta there;
  there.poses = {{kf(2), at(0.9), 7}, {kf(3), at(0.8), 5}};
  there.positions = {{pt(5), {9, 9, 9}, 7}};
  edge.commit(there);
  MapDelta here;
  here.poses = {{kf(2), at(0.3), 1}};
  here.positions = {{pt(5), {0, 0, 3}, 1}};
  mobile.commit(here);
  EXPECT_EQ(hand_over().stale, 0);
  edge.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe(kf(2))->T_cw.t.x(), 0.3);
    EXPECT_EQ(view.keyframe(kf(2))->version, 8u);
    EXPECT_EQ(view.point(pt(5))->p_w.z(), 3);
    EXPECT_EQ(view.keyframe(kf(3))->T_cw.t.x(), 0.8);  // not changed on this side
    return 0;
  });
}

TEST_F(MapSync, FusedPointsAreFollowedAndRemovedOnesStayAway) {
  MapDelta there;
  there.fusions = {{pt(7), pt(9)}};
  there.culled_points = {pt(11)};
  there.culled_keyframes = {kf(3)};
  edge.commit(there);
  MapDelta here;
  here.points = {testing::new_point(41)};
  here.keyframes = {testing::new_keyframe(5, {7, 11, 41, 1, 2, 3})};
  here.attach = {{kf(3), 35, pt(41)}};
  mobile.commit(here);
  hand_over();
  edge.read([](const MapView& view) {
    const KeyFrame* added = view.keyframe(kf(5));
    EXPECT_EQ(added->points[0], pt(9));
    EXPECT_FALSE(added->points[1]);
    EXPECT_EQ(added->points[2], pt(41));
    EXPECT_EQ(view.point(pt(11)), nullptr);
    EXPECT_EQ(view.keyframe(kf(3)), nullptr);
    return 0;
  });
}

TEST_F(MapSync, AKeyframeKnownToBothGainsWhatItLacks) {
  MapDelta both;
  both.keyframes = {testing::new_keyframe(6, testing::points_from(1, 20))};
  edge.commit(both);
  mobile.commit(both);
  MapDelta here;
  here.points = {testing::new_point(42)};
  here.attach = {{kf(6), 30, pt(42)}, {kf(2), 30, pt(42)}};
  here.poses = {{kf(6), at(0.7), 1}};
  mobile.commit(here);
  hand_over();  // keyframe 6 is not in the base
  edge.read([](const MapView& view) {
    EXPECT_EQ(view.keyframe(kf(6))->points[30], pt(42));
    EXPECT_EQ(view.keyframe(kf(6))->T_cw.t.x(), 0.7);
    EXPECT_EQ(view.point(pt(42))->observations.size(), 2u);
    return 0;
  });
}

TEST_F(MapSync, PointsThatNothingSeesThereAreLeftOut) {
  MapDelta there;
  there.culled_keyframes = {kf(3)};
  edge.commit(there);
  MapDelta delta;
  delta.points = {testing::new_point(43)};
  delta.keyframes = {testing::new_keyframe(3, {43})};  // was culled on the edge
  const MapDelta rebased =
      edge.read([&](const MapView& view) { return rebase_changes(view, delta); });
  EXPECT_TRUE(rebased.keyframes.empty());
  EXPECT_TRUE(rebased.points.empty());
}

TEST_F(MapSync, APointSeenOnlyByAKeyframeThatIsGoneThereIsLeftOut) {
  MapDelta there;
  there.culled_keyframes = {kf(3)};
  edge.commit(there);
  MapDelta here;
  here.points = {testing::new_point(44)};
  here.attach = {{kf(3), 35, pt(44)}};
  mobile.commit(here);
  const MapDelta delta = changes();
  ASSERT_EQ(delta.points.size(), 1u);
  const MapDelta rebased =
      edge.read([&](const MapView& view) { return rebase_changes(view, delta); });
  EXPECT_TRUE(rebased.points.empty());
  EXPECT_TRUE(rebased.attach.empty());
}

}  // namespace
}  // namespace slambed
