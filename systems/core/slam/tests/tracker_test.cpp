// SPDX-License-Identifier: Apache-2.0
#include "slam/tracker.hpp"

#include <gtest/gtest.h>

#include "slam/local_mapper.hpp"
#include "slam/trajectory.hpp"
#include "synthetic_world.hpp"

namespace slambed::testing {
namespace {

/// A tracker that makes keyframes whenever it may, but no mapper: the map is what it saw itself.
class Rig {
 public:
  explicit Rig(TrackerOptions options = {})
      : map(std::make_shared<Map>()), tracker(options, map, IdSpace::kTracker) {}

  TrackOutcome show(std::shared_ptr<const FeatureSet> features, bool keyframes = true) {
    const TrackOutcome outcome = tracker.track(frame, frame / 30.0, std::move(features));
    ++frame;
    if (keyframes && tracker.wants_keyframe({})) {
      const MapDelta delta = tracker.create_keyframe();
      EXPECT_EQ(delta.keyframes.size(), 1u);
    }
    return outcome;
  }
  std::size_t keyframes() const {
    return map->read([](const MapView& view) { return view.keyframe_count(); });
  }

  std::shared_ptr<Map> map;
  Tracker tracker;
  std::uint64_t frame = 0;
};

/// The true pose in the map's world, which begins at the first camera.
SE3 truth(int frame) { return walk(frame) * walk(0).inverse(); }

TEST(Tracker, FirstFrameBecomesTheFirstKeyFrame) {
  SyntheticWorld world;
  Rig rig;
  const auto features = world.look(walk(0));
  const TrackOutcome outcome = rig.tracker.track(7, 0.5, features);
  EXPECT_EQ(outcome.state, TrackingState::kOk);
  EXPECT_TRUE(outcome.initialised_now);
  EXPECT_EQ(rig.tracker.keyframe_need(), KeyFrameNeed::kUrgent);
  EXPECT_TRUE(rig.tracker.wants_keyframe({false, 9, true}));
  const MapDelta delta = rig.tracker.create_keyframe();
  ASSERT_EQ(delta.keyframes.size(), 1u);
  EXPECT_EQ(delta.keyframes[0].id, outcome.reference);
  EXPECT_EQ(delta.keyframes[0].frame_index, 7u);
  EXPECT_EQ(delta.points.size(), static_cast<std::size_t>(features->size()));
  EXPECT_EQ(rig.map->commit(delta).applied, 0) << "it was committed already";
  EXPECT_EQ(rig.tracker.keyframe_need(), KeyFrameNeed::kNone);
  EXPECT_EQ(rig.keyframes(), 1u);
}

TEST(Tracker, NoiseFreePathIsExact) {
  SyntheticWorld world;
  Rig rig;
  for (int i = 0; i < 150; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_EQ(outcome.by_motion_model, i >= 2) << "frame " << i;
    // Only float rounding of pixels and depths is left.
    EXPECT_LT(centre_error(outcome.T_cw, truth(i)), 1e-3) << "frame " << i;
    EXPECT_LT(turn_error_deg(outcome.T_cw, truth(i)), 0.02) << "frame " << i;
    if (i > 0) {
      EXPECT_GT(outcome.inliers, 300) << "frame " << i;
    }
  }
  EXPECT_GT(rig.keyframes(), 1u);
}

TEST(Tracker, NoisyPathStaysWithinCentimetres) {
  SyntheticWorld world;
  Rig rig;
  double worst_m = 0, worst_deg = 0;
  for (int i = 0; i < 150; ++i) {
    const TrackOutcome outcome = rig.show(world.look(
        walk(i),
        {.pixel_noise = 0.5, .depth_noise = 0.01, .flipped_bits = 15, .wrong_share = 0.1}));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    worst_m = std::max(worst_m, centre_error(outcome.T_cw, truth(i)));
    worst_deg = std::max(worst_deg, turn_error_deg(outcome.T_cw, truth(i)));
  }
  EXPECT_LT(worst_m, 0.03);
  EXPECT_LT(worst_deg, 0.5);
}

TEST(Tracker, SameInputSamePosesToTheLastBit) {
  const auto run = [] {
    SyntheticWorld world;
    Rig rig;
    std::vector<double> numbers;
    for (int i = 0; i < 40; ++i) {
      const TrackOutcome outcome = rig.show(world.look(walk(i), {.pixel_noise = 0.5}));
      for (int k = 0; k < 3; ++k) numbers.push_back(outcome.T_cw.t[k]);
      numbers.push_back(outcome.inliers);
    }
    return numbers;
  };
  EXPECT_EQ(run(), run());
}

TEST(Tracker, NeedsDepthAndFeaturesToBegin) {
  SyntheticWorld world;
  Rig rig;
  EXPECT_EQ(rig.show(world.nothing()).state, TrackingState::kNotInitialised);
  EXPECT_EQ(rig.show(world.look(walk(0), {}, 500)).state, TrackingState::kNotInitialised);
  EXPECT_EQ(rig.show(world.look(walk(0), {.depth_limit_m = 0})).state,
            TrackingState::kNotInitialised);
  EXPECT_FALSE(rig.tracker.wants_keyframe({}));
  EXPECT_TRUE(rig.tracker.create_keyframe().empty());
  EXPECT_EQ(rig.show(world.look(walk(0), {}, 501)).state, TrackingState::kOk);
}

TEST(Tracker, LostEarlyStartsOver) {
  SyntheticWorld world;
  Rig rig;
  rig.show(world.look(walk(0)));
  rig.show(world.look(walk(1)));
  const TrackOutcome outcome = rig.show(world.nothing());
  EXPECT_EQ(outcome.state, TrackingState::kNotInitialised);
  EXPECT_TRUE(outcome.reset_now);
  EXPECT_EQ(rig.keyframes(), 0u);
  const TrackOutcome again = rig.show(world.look(walk(3)));
  EXPECT_TRUE(again.initialised_now);
  EXPECT_EQ(again.reference.value & 0xff, 2u) << "ids are never reused";
}

TEST(Tracker, SurvivesBlackFramesAndFindsItsPlaceAgain) {
  SyntheticWorld world;
  Rig rig({.reset_below_keyframes = 1});
  for (int i = 0; i < 60; ++i) rig.show(world.look(walk(i)));
  for (int i = 0; i < 5; ++i) {
    const TrackOutcome black = rig.show(world.nothing());
    EXPECT_EQ(black.state, TrackingState::kLost);
    EXPECT_EQ(rig.tracker.keyframe_need(), KeyFrameNeed::kNone);
    EXPECT_TRUE(rig.tracker.create_keyframe().empty());
  }
  for (int i = 70; i < 80; ++i) {
    const TrackOutcome back = rig.show(world.look(walk(i)));
    ASSERT_EQ(back.state, TrackingState::kOk) << "frame " << i;
    EXPECT_LT(centre_error(back.T_cw, truth(i)), 2e-3);
    EXPECT_EQ(back.by_motion_model, i >= 72);
  }
}

TEST(Tracker, RelocalisesAfterAJumpToAKnownPlace) {
  SyntheticWorld world;
  Rig rig({.reset_below_keyframes = 1});
  for (int i = 0; i < 120; ++i) rig.show(world.look(walk(i)));
  // Looks at the wall behind, never seen, then at a place from long ago.
  const SE3 behind(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()).toRotationMatrix(),
                   Eigen::Vector3d::Zero());
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(rig.show(world.look(behind * walk(110))).state, TrackingState::kLost);
  bool found = false;
  for (int i = 20; i < 30 && !found; ++i) {
    const TrackOutcome back = rig.show(world.look(walk(i)));
    found = back.state == TrackingState::kOk;
    if (found) {
      EXPECT_LT(centre_error(back.T_cw, truth(i)), 2e-3);
    }
  }
  EXPECT_TRUE(found);
}

TEST(Tracker, DuplicateFramesDoNotHurt) {
  SyntheticWorld world;
  Rig rig;
  for (int i = 0; i < 60; ++i) {
    const auto features = world.look(walk(i));
    for (int copy = 0; copy < 1 + i % 3; ++copy) {
      const TrackOutcome outcome = rig.show(features);
      ASSERT_EQ(outcome.state, TrackingState::kOk);
      EXPECT_LT(centre_error(outcome.T_cw, truth(i)), 1e-3);
    }
  }
}

TEST(Tracker, FallsBackToTheReferenceKeyFrameWhenMotionModelFails) {
  SyntheticWorld world;
  Rig rig;
  for (int i = 0; i < 20; ++i) rig.show(world.look(walk(i)));
  // A kick of 17 degrees between two frames moves everything by 150 px or more.
  const SE3 kick(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0, 0, 0});
  const TrackOutcome outcome = rig.show(world.look(kick * walk(20)), false);
  EXPECT_EQ(outcome.state, TrackingState::kOk);
  EXPECT_FALSE(outcome.by_motion_model);
  EXPECT_LT(centre_error(outcome.T_cw, kick * truth(20)), 1e-3);
}

TEST(Tracker, WordsHaveTheLastWordWithoutTheSecondLook) {
  for (const bool again : {true, false}) {
    SyntheticWorld world;
    Tracker tracker({.reset_below_keyframes = 0, .second_hypotheses = false, .descriptor_fallback = again},
                    std::make_shared<Map>(), IdSpace::kTracker);
    for (int i = 0; i < 10; ++i) {
      tracker.track(i, i / 30.0, world.look(walk(i)));
      if (i == 0) tracker.create_keyframe();
    }
    // A kick, and few features, whose words are mostly others.
    const SE3 kick(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()).toRotationMatrix(), {0, 0, 0});
    const TrackOutcome outcome =
        tracker.track(10, 10 / 30.0, world.look(kick * walk(10), {.flipped_bits = 40}, 60));
    ASSERT_TRUE(outcome.search.motion_matches && outcome.search.word_matches);
    EXPECT_LT(*outcome.search.motion_matches, 20);
    EXPECT_LT(*outcome.search.word_matches, 15);
    if (again) {
      EXPECT_GE(*outcome.search.reference_matches, 15);
    } else {
      EXPECT_EQ(outcome.search.reference_matches, outcome.search.word_matches);
      EXPECT_EQ(outcome.state, TrackingState::kLost);
    }
    EXPECT_FALSE(outcome.by_motion_model);
  }
}

TEST(Tracker, ZeroDepthMidwayIsTrackedMonocularly) {
  SyntheticWorld world;
  Rig rig;
  for (int i = 0; i < 20; ++i) rig.show(world.look(walk(i)));
  for (int i = 20; i < 30; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i), {.depth_limit_m = 0}));
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_LT(centre_error(outcome.T_cw, truth(i)), 1e-3);
  }
}

TEST(Tracker, KeyFrameTakesCloseFeaturesAndSightings) {
  SyntheticWorld world;
  Rig rig;
  rig.show(world.look(walk(0)));
  for (int i = 1; i < 12; ++i) rig.show(world.look(walk(i)), false);
  const MapDelta delta = rig.tracker.create_keyframe();
  ASSERT_EQ(delta.keyframes.size(), 1u);
  const NewKeyFrame& keyframe = delta.keyframes[0];
  const Sensor& sensor = *world.sensor();
  for (int i = 0; i < keyframe.features->size(); ++i)
    if (keyframe.features->keypoint(i).depth_m < sensor.close_depth_m) {
      EXPECT_TRUE(keyframe.points[i]);
    }
  ASSERT_GT(delta.sightings.size(), 300u);
  int ten_times = 0;
  for (const PointSightings& s : delta.sightings) {
    EXPECT_LE(s.found, s.visible);
    ten_times += s.found >= 10;
  }
  EXPECT_GT(ten_times, 200);
  EXPECT_EQ(rig.tracker.create_keyframe().sightings.size(), 0u) << "handed on only once";
}

TEST(Tracker, FollowsCorrectionsOfTheMap) {
  SyntheticWorld world;
  Rig rig;
  TrajectoryRecorder recorder;
  for (int i = 0; i < 40; ++i) recorder.add(i / 30.0, rig.show(world.look(walk(i))));
  // Somebody found out that the world is turned and somewhere else.
  const SE3 T_new_old(
      Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(), {3, -2, 5});
  const MapDelta correction = rig.map->read([&](const MapView& view) {
    MapDelta delta;
    for (const KeyFrameId id : view.keyframe_ids())
      delta.poses.push_back({id, view.keyframe(id)->T_cw * T_new_old.inverse(), 1});
    for (const MapPointId id : view.point_ids())
      delta.positions.push_back({id, T_new_old * view.point(id)->p_w, 1});
    return delta;
  });
  rig.map->commit(correction);
  for (int i = 40; i < 60; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    recorder.add(i / 30.0, outcome);
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_TRUE(outcome.by_motion_model);
    EXPECT_LT(centre_error(outcome.T_cw, truth(i) * T_new_old.inverse()), 1e-3);
  }
  const auto poses = recorder.final_poses(*rig.map);
  ASSERT_EQ(poses.size(), 60u);
  for (int i = 0; i < 60; ++i)
    EXPECT_LT(centre_error(poses[i].T_cw, truth(i) * T_new_old.inverse()), 1e-3);
  EXPECT_LT(centre_error(recorder.live_poses()[10].T_cw, truth(10)), 1e-3);
}

TEST(Tracker, FollowsFusionsAndCulls) {
  SyntheticWorld world;
  Rig rig;
  for (int i = 0; i < 30; ++i) rig.show(world.look(walk(i)));
  const MapDelta edit = rig.map->read([](const MapView& view) {
    MapDelta delta;
    const auto ids = view.point_ids();
    for (std::size_t i = 0; i < ids.size(); i += 4) delta.culled_points.push_back(ids[i]);
    return delta;
  });
  rig.map->commit(edit);
  for (int i = 30; i < 40; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_LT(centre_error(outcome.T_cw, truth(i)), 1e-3);
  }
}

TEST(Tracker, ProvisionalKeyFrameDoesNotBecomeTheReference) {
  SyntheticWorld world;
  Rig rig;
  const KeyFrameId first = rig.show(world.look(walk(0))).reference;
  for (int i = 1; i < 10; ++i) rig.show(world.look(walk(i)), false);
  ASSERT_FALSE(rig.tracker.create_keyframe(false).keyframes.empty());
  for (int i = 10; i < 20; ++i) EXPECT_EQ(rig.show(world.look(walk(i)), false).reference, first);
  ASSERT_FALSE(rig.tracker.create_keyframe(true).keyframes.empty());
  EXPECT_NE(rig.show(world.look(walk(20)), false).reference, first);
}

TEST(Tracker, ResumesAtAPoseThatSomebodyElseFound) {
  SyntheticWorld world;
  Rig rig({.reset_below_keyframes = 0});
  KeyFrameId old;
  for (int i = 0; i < 120; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    if (i == 20) old = outcome.reference;
  }
  const SE3 pose = truth(20);
  EXPECT_FALSE(rig.tracker.resume(pose, old)) << "not lost";
  EXPECT_EQ(rig.show(world.nothing()).state, TrackingState::kLost);
  EXPECT_FALSE(rig.tracker.resume(pose, KeyFrameId{12345})) << "nobody knows that keyframe";
  EXPECT_EQ(rig.tracker.state(), TrackingState::kLost);
  ASSERT_TRUE(rig.tracker.resume(pose, old));
  EXPECT_EQ(rig.tracker.state(), TrackingState::kOk);
  EXPECT_FALSE(rig.tracker.wants_keyframe({}));
  for (int i = 23; i < 30; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_LT(centre_error(outcome.T_cw, truth(i)), 2e-3);
  }
}

TEST(Tracker, AWrongPoseIsNotBelievedForLong) {
  SyntheticWorld world, other(5000, 2);
  Rig rig({.reset_below_keyframes = 0});
  for (int i = 0; i < 30; ++i) rig.show(world.look(walk(i)));
  const TrackOutcome last = rig.show(world.look(walk(30)), false);
  EXPECT_EQ(rig.show(other.look(walk(31))).state, TrackingState::kLost);
  ASSERT_TRUE(rig.tracker.resume(last.T_cw, last.reference));
  EXPECT_EQ(rig.show(other.look(walk(32))).state, TrackingState::kLost);
}

/// A keyframe as if it were a lost frame that somebody has found.
FoundFrame found_at(const Map& map, KeyFrameId id) {
  return map.read([&](const MapView& view) {
    const KeyFrame& keyframe = *view.keyframe(id);
    return FoundFrame{.index = keyframe.frame_index,
                      .timestamp_s = keyframe.timestamp_s,
                      .features = keyframe.features,
                      .T_cw = keyframe.T_cw,
                      .reference = id,
                      .points = keyframe.points};
  });
}

TEST(Tracker, GoesOnFromAFrameThatSomebodyElseFoundAndIsLostUntilThen) {
  SyntheticWorld world;
  Rig rig({.reset_below_keyframes = 0});
  KeyFrameId old;
  int seen_at = 0;
  for (int i = 0; i < 120; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    if (i == 20) old = outcome.reference;
  }
  const Map& map = *rig.tracker.map();
  FoundFrame found = found_at(map, old);
  seen_at = static_cast<int>(found.index);
  EXPECT_FALSE(rig.tracker.resume(found)) << "not lost";
  EXPECT_EQ(rig.show(world.nothing()).state, TrackingState::kLost);
  FoundFrame unknown = found;
  unknown.reference = KeyFrameId{12345};
  EXPECT_FALSE(rig.tracker.resume(unknown)) << "nobody knows that keyframe";
  FoundFrame cut = found;
  cut.points.pop_back();
  EXPECT_FALSE(rig.tracker.resume(cut)) << "matches of another frame";
  ASSERT_TRUE(rig.tracker.resume(found));
  EXPECT_EQ(rig.tracker.state(), TrackingState::kLost);
  for (int i = seen_at + 2; i < seen_at + 8; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << "frame " << i;
    EXPECT_EQ(outcome.resumed, i == seen_at + 2);
    EXPECT_LT(centre_error(outcome.T_cw, truth(i)), 2e-3);
  }
}

TEST(Tracker, AFrameThatWasFoundAtAWrongPlaceEndsNoLoss) {
  SyntheticWorld world, other(5000, 2);
  Rig rig({.reset_below_keyframes = 0});
  for (int i = 0; i < 30; ++i) rig.show(world.look(walk(i)));
  const KeyFrameId last = rig.show(world.look(walk(30)), false).reference;
  const FoundFrame found = found_at(*rig.tracker.map(), last);
  EXPECT_EQ(rig.show(other.look(walk(31))).state, TrackingState::kLost);
  ASSERT_TRUE(rig.tracker.resume(found));
  const TrackOutcome outcome = rig.show(other.look(walk(32)));
  EXPECT_EQ(outcome.state, TrackingState::kLost);
  EXPECT_FALSE(outcome.resumed);
  // It is tried once; the next frame is a lost one as any.
  EXPECT_EQ(rig.show(world.look(walk(33))).state, TrackingState::kOk);
}

TEST(Tracker, StartsInTheWorldOfAnotherMap) {
  SyntheticWorld world;
  Rig rig;
  rig.tracker.start_at(walk(0));
  for (int i = 0; i < 20; ++i) {
    const TrackOutcome outcome = rig.show(world.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk);
    EXPECT_LT(centre_error(outcome.T_cw, walk(i)), 1e-3) << "frame " << i;
  }
  rig.show(world.nothing());  // starts over, at the same pose
  const TrackOutcome again = rig.show(world.look(walk(0)));
  ASSERT_TRUE(again.initialised_now);
  EXPECT_LT(centre_error(again.T_cw, walk(0)), 1e-9);
}

TEST(Tracker, TellsWhatItsRuleKnows) {
  SyntheticWorld world;
  Rig rig;
  rig.show(world.look(walk(0)));
  const TrackOutcome outcome = rig.show(world.look(walk(1)), false);
  const KeyFrameEvidence& evidence = rig.tracker.evidence();
  EXPECT_TRUE(evidence.tracked);
  EXPECT_EQ(evidence.inliers, outcome.inliers);
  EXPECT_EQ(evidence.keyframes, 1);
  EXPECT_EQ(evidence.frames_since_keyframe, 1);
  EXPECT_GT(evidence.close_tracked, 0);
  EXPECT_GE(outcome.searched_points, outcome.local_points);
  rig.show(world.nothing());
  EXPECT_FALSE(rig.tracker.evidence().tracked);
}

}  // namespace
}  // namespace slambed::testing
