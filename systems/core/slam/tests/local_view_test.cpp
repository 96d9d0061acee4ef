// SPDX-License-Identifier: Apache-2.0
#include "slam/local_view.hpp"

#include <gtest/gtest.h>

#include "slam/keyframe_maker.hpp"
#include "slam/trajectory.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

constexpr auto anyone = [](KeyFrameId) { return true; };

class LocalViewTest : public ::testing::Test {
 protected:
  KeyFrameId add_keyframe(int frame_number) {
    Frame frame;
    frame.begin(frame_number, 0, scene.look(walk(frame_number)));
    const MapDelta delta =
        make_keyframe(map, frame, walk(frame_number), NewPoints::kAllWithDepth, ids);
    map.commit(delta);
    last = frame;
    return delta.keyframes[0].id;
  }

  SyntheticScene scene;
  Map map;
  TrackerIds ids{IdSpace::kTracker};
  LocalView view;
  Frame last;
};

TEST_F(LocalViewTest, IsCopiedOnlyWhenSomethingChanged) {
  const KeyFrameId a = add_keyframe(0);
  auto update = view.update(map, last, anyone);
  EXPECT_EQ(update.reference, a);
  EXPECT_TRUE(update.copied);
  EXPECT_EQ(view.points().size(), static_cast<std::size_t>(last.matches()));
  EXPECT_FALSE(view.update(map, last, anyone).copied);

  MapDelta delta;
  delta.observation_counts = {{last.points[0], 5, 5}};
  map.commit(delta);
  EXPECT_FALSE(view.update(map, last, anyone).copied) << "observations do not matter";

  delta = {};
  delta.positions = {{last.points[0], {1, 2, 3}, 1}};
  map.commit(delta);
  EXPECT_TRUE(view.update(map, last, anyone).copied);
  EXPECT_EQ(view.points()[0].p_w, Eigen::Vector3d(1, 2, 3));
}

TEST_F(LocalViewTest, TakesAwayMatchesOfPointsThatAreGone) {
  add_keyframe(0);
  const MapPointId gone = last.points[3];
  MapDelta delta;
  delta.culled_points = {gone};
  map.commit(delta);
  view.update(map, last, anyone);
  EXPECT_FALSE(last.points[3]);
}

TEST_F(LocalViewTest, ReferenceIsTheOneWithMostVotesThatMayBe) {
  const KeyFrameId a = add_keyframe(0);
  const Frame first = last;
  const KeyFrameId b = add_keyframe(1);
  Frame mixed = last;
  mixed.points.resize(100);
  mixed.points.insert(mixed.points.end(), first.points.begin(), first.points.begin() + 40);
  mixed.outlier.resize(mixed.points.size());
  EXPECT_EQ(view.update(map, mixed, anyone).reference, b);
  EXPECT_EQ(view.update(map, mixed, [&](KeyFrameId id) { return id != b; }).reference, a);
}

TEST_F(LocalViewTest, ObservationCountsAreAbsoluteAndSorted) {
  add_keyframe(0);
  view.update(map, last, anyone);
  for (int turn = 0; turn < 3; ++turn)
    for (std::size_t i = 0; i < 10; ++i) view.count_visible(9 - i);
  view.count_found(view.points()[4].id);
  view.keep_observation_counts();
  view.begin_look();
  view.count_visible(20);
  view.begin_look();  // drops the last search, which had a wrong pose
  const auto observation_counts = view.take_observation_counts(map);
  ASSERT_EQ(observation_counts.size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_EQ(observation_counts[i].visible, 4u);  // a point starts as seen and found once
    EXPECT_EQ(observation_counts[i].found,
              observation_counts[i].id == view.points()[4].id ? 2u : 1u);
    if (i > 0) {
      EXPECT_LT(observation_counts[i - 1].id, observation_counts[i].id);
    }
  }
  EXPECT_TRUE(view.take_observation_counts(map).empty());
}

TEST_F(LocalViewTest, TrajectoryKeepsNotedPosesOfKeyFramesThatALaterMapDoesNotKnow) {
  const KeyFrameId a = add_keyframe(0);
  TrackOutcome outcome;
  outcome.state = TrackingState::kOk;
  outcome.reference = a;
  outcome.T_cr = SE3(Eigen::Matrix3d::Identity(), {0, 0, 1});
  outcome.T_cw = SE3(Eigen::Matrix3d::Identity(), {7, 7, 7});
  TrajectoryRecorder recorder;
  recorder.add(1, outcome);
  TrackOutcome lost;
  lost.state = TrackingState::kLost;
  recorder.add(2, lost);
  ASSERT_EQ(recorder.size(), 1u);
  const Map empty;
  EXPECT_EQ(recorder.final_poses(empty)[0].T_cw.t.x(), 7);
  recorder.note(map);
  EXPECT_LT((recorder.final_poses(empty)[0].T_cw.t - (walk(0).t + Eigen::Vector3d(0, 0, 1))).norm(),
            1e-12);
  lost.reset_now = true;
  recorder.add(3, lost);
  EXPECT_EQ(recorder.size(), 0u);
}

}  // namespace
}  // namespace slambed::testing
