// SPDX-License-Identifier: Apache-2.0
// A monocular camera: the first map from two views, then tracking and mapping.
#include <gtest/gtest.h>

#include "geometry/alignment.hpp"
#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"
#include "slam/two_view_start.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

TrackerOptions mono_options() { return suited({}, SensorKind::kMono); }

struct Start {
  int frame = -1;  ///< the one that became the second keyframe
  MapDelta delta;
  SE3 T_cw;
};

/// Offers frames until there is a map.
Start start(SyntheticScene& scene, const Seeing& seeing, SE3 (*path)(int), int most = 40) {
  TwoViewStart two_views;
  TrackerIds ids(IdSpace::kTracker);
  Frame frame;
  for (int i = 0; i < most; ++i) {
    frame.begin(static_cast<std::uint64_t>(i), i / 30.0, scene.look(path(i), seeing));
    if (auto delta = two_views.offer(frame, ids)) return {i, std::move(*delta), frame.T_cw};
  }
  return {};
}

TEST(TwoViewStart, TwoKeyFramesWithUnitMedianDepth) {
  SyntheticScene scene(5000, 1, true);
  const Start made = start(scene, {}, stroll);
  ASSERT_GT(made.frame, 0);
  ASSERT_EQ(made.delta.keyframes.size(), 2u);
  const NewKeyFrame &first = made.delta.keyframes[0], &second = made.delta.keyframes[1];
  EXPECT_EQ(first.frame_index, 0u);
  EXPECT_EQ(second.frame_index, static_cast<std::uint64_t>(made.frame));
  EXPECT_LT(first.id, second.id);
  EXPECT_EQ(first.T_cw.t, Eigen::Vector3d::Zero());
  EXPECT_GE(made.delta.points.size(), 100u);
  std::vector<double> depths;
  for (const NewPoint& point : made.delta.points) depths.push_back(point.p_w.z());
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  EXPECT_NEAR(depths[depths.size() / 2], 1, 1e-9);
  // The motion is correct up to scale.
  const SE3 truth = stroll(made.frame) * stroll(0).inverse();
  EXPECT_LT(turn_error_deg(second.T_cw, truth), 0.02);
  EXPECT_GT(second.T_cw.t.normalized().dot(truth.t.normalized()), 0.99999);
}

TEST(TwoViewStart, NoiseAndWrongMatchesAreSurvived) {
  SyntheticScene scene(5000, 2, true);
  const Start made =
      start(scene, {.pixel_noise = 0.4, .flipped_bits = 15, .wrong_share = 0.1}, stroll);
  ASSERT_GT(made.frame, 0);
  const SE3 truth = stroll(made.frame) * stroll(0).inverse();
  EXPECT_LT(turn_error_deg(made.T_cw, truth), 0.5);
  EXPECT_GT(made.T_cw.t.normalized().dot(truth.t.normalized()), 0.98);
}

TEST(TwoViewStart, TurningOnTheSpotMakesNoMap) {
  SyntheticScene scene(5000, 3, true);
  const auto turn = [](int i) {
    return SE3(Eigen::AngleAxisd(0.01 * i, Eigen::Vector3d::UnitY()).toRotationMatrix(),
               Eigen::Vector3d::Zero());
  };
  EXPECT_EQ(start(scene, {.pixel_noise = 0.3}, turn).frame, -1);
}

TEST(TwoViewStart, AViewThatIsGoneIsGivenUp) {
  SyntheticScene scene(5000, 4, true);
  TwoViewStart two_views;
  TrackerIds ids(IdSpace::kTracker);
  Frame frame;
  const auto offer = [&](int i, std::shared_ptr<const FeatureSet> features) {
    frame.begin(static_cast<std::uint64_t>(i), i, std::move(features));
    return two_views.offer(frame, ids);
  };
  const SE3 behind(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                   Eigen::Vector3d::Zero());
  EXPECT_FALSE(offer(0, scene.look(behind * stroll(0))));
  EXPECT_FALSE(offer(1, scene.look(stroll(0))));
  // Frame 0 saw another place, so frame 1 waits now.
  std::optional<MapDelta> delta;
  for (int i = 2; i < 40 && !delta; ++i) delta = offer(i, scene.look(stroll(i)));
  ASSERT_TRUE(delta);
  EXPECT_EQ(delta->keyframes[0].frame_index, 1u);
}

struct MonoWalk {
  std::vector<Eigen::Vector3d> estimate, truth;
  int started = -1, tracked = 0, resets = 0;
  std::size_t keyframes = 0, points = 0;
};

MonoWalk walk_and_map(int frames, const Seeing& seeing) {
  SyntheticScene scene(5000, 1, true);
  auto map = std::make_shared<Map>();
  Tracker tracker(mono_options(), map, IdSpace::kTracker);
  LocalMapper mapper({}, map, IdSpace::kEdgeMapper);
  MonoWalk run;
  for (int i = 0; i < frames; ++i) {
    const TrackOutcome outcome = tracker.track(i, i / 30.0, scene.look(stroll(i), seeing));
    run.resets += outcome.reset_now;
    if (outcome.initialized_now && run.started < 0) run.started = i;
    if (outcome.state == TrackingState::kOk) {
      ++run.tracked;
      run.estimate.push_back(outcome.T_cw.inverse().t);
      run.truth.push_back(stroll(i).inverse().t);
    }
    if (!tracker.wants_keyframe({})) continue;
    for (const NewKeyFrame& keyframe : tracker.create_keyframe().keyframes) {
      mapper.insert(keyframe.id);
      map->commit(mapper.cull_points());
      map->commit(mapper.triangulate());
      map->commit(mapper.fuse());
      if (mapper.begin_bundle()) {
        while (mapper.step_bundle()) {
        }
        map->commit(mapper.finish_bundle());
      }
      map->commit(mapper.cull_keyframes());
    }
  }
  map->read([&](const MapView& view) {
    run.keyframes = view.keyframe_count();
    run.points = view.point_count();
    return 0;
  });
  return run;
}

double rms_after_sim3_m(const MonoWalk& run) {
  const auto S = align_sim3(run.estimate, run.truth);
  if (!S) return 1e9;
  double sum = 0;
  for (std::size_t i = 0; i < run.truth.size(); ++i)
    sum += (*S * run.estimate[i] - run.truth[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(run.truth.size()));
}

TEST(MonoRun, APerfectCameraIsTrackedToMillimetres) {
  constexpr int kFrames = 180;
  const MonoWalk run = walk_and_map(kFrames, {});
  ASSERT_GE(run.started, 0);
  EXPECT_LT(run.started, 30);
  EXPECT_EQ(run.tracked, kFrames - run.started);
  EXPECT_EQ(run.resets, 0);
  EXPECT_LT(rms_after_sim3_m(run), 0.005);
  EXPECT_GT(run.points, 500u);
  EXPECT_LT(run.keyframes, 90u);
}

TEST(MonoRun, ANoisyCameraIsTrackedToCentimetres) {
  constexpr int kFrames = 180;
  const MonoWalk run =
      walk_and_map(kFrames, {.pixel_noise = 0.5, .flipped_bits = 15, .wrong_share = 0.1});
  ASSERT_GE(run.started, 0);
  EXPECT_EQ(run.tracked, kFrames - run.started);
  EXPECT_LT(rms_after_sim3_m(run), 0.02);
}

TEST(MonoRun, LostTooEarlyItStartsAnew) {
  SyntheticScene scene(5000, 1, true);
  auto map = std::make_shared<Map>();
  Tracker tracker(mono_options(), map, IdSpace::kTracker);
  int i = 0;
  while (tracker.track(i, i, scene.look(stroll(i))).state != TrackingState::kOk) ASSERT_LT(++i, 40);
  tracker.create_keyframe();
  ++i;
  const TrackOutcome blind = tracker.track(i, i, scene.nothing());
  EXPECT_TRUE(blind.reset_now);
  EXPECT_EQ(blind.state, TrackingState::kNotInitialized);
  const int blind_at = i;
  while (tracker.track(i, i, scene.look(stroll(i))).state != TrackingState::kOk)
    ASSERT_LT(++i, blind_at + 150);
  EXPECT_EQ(tracker.create_keyframe().keyframes.size(), 2u);
}

TEST(MonoRun, IsRepeatableToTheLastBit) {
  const MonoWalk a = walk_and_map(60, {.pixel_noise = 0.5});
  const MonoWalk b = walk_and_map(60, {.pixel_noise = 0.5});
  ASSERT_EQ(a.estimate.size(), b.estimate.size());
  for (std::size_t i = 0; i < a.estimate.size(); ++i) EXPECT_EQ(a.estimate[i], b.estimate[i]);
}

}  // namespace
}  // namespace slambed::testing
