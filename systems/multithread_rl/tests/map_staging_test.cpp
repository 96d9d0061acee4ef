// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/map_staging.hpp"

#include <gtest/gtest.h>

#include "map/tests/map_fixture.hpp"
#include "multithread_rl/keyframe_backup.hpp"
#include "multithread_rl/tests/staging_interleavings.hpp"

namespace slambed {
namespace {

using testing::Interleaving;
using testing::keyframes_in;
using testing::Seen;
using testing::StagingScenario;
using wire::keyframe_id;
using Backup = MapStaging::Backup;

/// Returns the keyframes carried over when two are made before the update begins and two after.
std::vector<KeyFrameId> carried_with(Backup backup) {
  StagingScenario scene(1, backup);
  for (int i = 0; i < 8; ++i) scene.make_keyframe(false);
  const MapDelta update = scene.update(6, 6);
  scene.staging.begin();
  scene.make_keyframe(true);
  scene.staging.insert(update, keyframe_id(6));
  scene.staging.relate();
  scene.staging.drain();
  scene.make_keyframe(true);
  scene.staging.set_ready();
  scene.swap();
  auto there = keyframes_in(*scene.staging.active());
  std::erase_if(there, [](KeyFrameId id) { return id <= keyframe_id(6); });
  return there;
}

TEST(MapStaging, BacksUpAsItIsTold) {
  EXPECT_TRUE(carried_with(Backup::kNone).empty());
  EXPECT_EQ(carried_with(Backup::kUpdate), (std::vector{keyframe_id(9), keyframe_id(10)}));
  EXPECT_EQ(carried_with(Backup::kUncovered),
            (std::vector{keyframe_id(7), keyframe_id(8), keyframe_id(9), keyframe_id(10)}));
}

std::vector<KeyFrameId> swapped_in(StagingScenario& scene, std::uint64_t newest) {
  const MapDelta update = scene.update(newest, 2);
  scene.staging.begin();
  scene.staging.insert(update, keyframe_id(newest));
  scene.staging.relate();
  scene.staging.drain();
  scene.staging.set_ready();
  scene.swap();
  return keyframes_in(*scene.staging.active());
}

TEST(MapStaging, TheRecoverysPlaceStaysUntilAnUpdateIsAllFromBehindIt) {
  for (const int recovery_keyframes : {0, 2}) {
    StagingScenario scene(5, Backup::kUpdate, recovery_keyframes);
    for (int i = 0; i < 8; ++i) scene.make_keyframe(false);
    scene.staging.recovered(keyframe_id(3));
    scene.make_keyframe(true);
    scene.make_keyframe(false);
    // The update does not cover the keyframes made since it and before it began.
    const auto first = swapped_in(scene, 8);
    if (recovery_keyframes == 0) {
      EXPECT_EQ(first, (std::vector{keyframe_id(7), keyframe_id(8)}));
      continue;
    }
    EXPECT_EQ(first, (std::vector{keyframe_id(3), keyframe_id(7), keyframe_id(8), keyframe_id(9),
                                  keyframe_id(10)}));
    EXPECT_EQ(scene.staging.provisional(), std::vector{keyframe_id(9)});
    // The update has one of the two.
    EXPECT_EQ(swapped_in(scene, 9),
              (std::vector{keyframe_id(3), keyframe_id(8), keyframe_id(9), keyframe_id(10)}));
    scene.make_keyframe(false);
    // The update has both; from the next one on, the backup is the paper's again.
    EXPECT_EQ(swapped_in(scene, 10), (std::vector{keyframe_id(9), keyframe_id(10)}));
  }
}

TEST(CarryOver, AKeyframeThatObservesOnlyWhatItMadeStaysSo) {
  using testing::kf;
  using testing::pt;
  for (const bool observes_known : {true, false}) {
    Map from, to;
    MapDelta first;
    for (int n = 1; n <= 20; ++n) first.points.push_back(testing::new_point(n));
    first.keyframes = {testing::new_keyframe(1, testing::points_from(1, 20))};
    from.commit(first);
    to.commit(first);
    MapDelta second;
    second.points = {testing::new_point(21)};
    second.points[0].first_keyframe = second.points[0].reference = kf(2);
    second.keyframes = {testing::new_keyframe(2, {21, 1, 2})};
    second.keyframes[0].observes_known = observes_known;
    from.commit(second);

    SharedKeyFrames shared(from, to);
    to.commit(carry_over(from, to, kf(2), shared));
    to.read([&](const MapView& view) {
      EXPECT_EQ(view.keyframe(kf(2))->points[1], pt(1));
      EXPECT_EQ(view.keyframe(kf(2))->connected.empty(), !observes_known);
      EXPECT_GT(view.point(pt(21))->weight, 0) << "its own";
      return 0;
    });
  }
}

TEST(MapStaging, WhatTheEdgeMayStillDeclineStaysProvisional) {
  StagingScenario scene(2);
  for (int i = 0; i < 8; ++i) scene.make_keyframe(true);
  const MapDelta update = scene.update(8, 6);
  scene.staging.begin();
  scene.staging.insert(update, keyframe_id(8));
  scene.staging.relate();
  scene.make_keyframe(true);
  scene.make_keyframe(false);
  scene.staging.drain();
  EXPECT_EQ(scene.staging.provisional(), std::vector{keyframe_id(9)});
}

TEST(MapStaging, TrackingsMapIsLeftAloneUntilTheSwap) {
  StagingScenario scene(3);
  for (int i = 0; i < 8; ++i) scene.make_keyframe(false);
  const auto active = scene.staging.active();
  const auto revision = active->revision();
  const MapDelta update = scene.update(8, 6);
  scene.staging.begin();
  scene.staging.insert(update, keyframe_id(8));
  scene.staging.relate();
  scene.staging.drain();
  EXPECT_FALSE(scene.staging.ready());
  EXPECT_EQ(active->revision(), revision);
  EXPECT_EQ(scene.staging.active(), active);
  scene.staging.set_ready();
  EXPECT_TRUE(scene.staging.ready());
}

TEST(MapStaging, AnUpdateThatWasGivenUpLeavesNothingBehind) {
  StagingScenario scene(4);
  for (int i = 0; i < 8; ++i) scene.make_keyframe(false);
  const MapDelta first = scene.update(8, 6), second = scene.update(8, 2);
  scene.staging.begin();
  scene.staging.insert(first, keyframe_id(8));
  scene.make_keyframe(false);
  scene.staging.cancel();
  EXPECT_EQ(scene.staging.waiting(), 0u);
  scene.staging.begin();
  scene.staging.insert(second, keyframe_id(8));
  scene.staging.relate();
  scene.staging.set_ready();
  scene.swap();
  EXPECT_EQ(keyframes_in(*scene.staging.active()), (std::vector{keyframe_id(7), keyframe_id(8)}));
}

TEST(StagingInterleavings, KeepKeyframesRecoveriesAnswersAndTheLastFrameInAnyOrderOfEvents) {
  Seen seen;
  for (unsigned seed = 1; seed <= 1000; ++seed) {
    Interleaving interleaving(seed, seen);
    interleaving.run(60);
    ASSERT_FALSE(HasFailure()) << "seed " << seed;
  }
  EXPECT_GT(seen.swaps, 1000);
  EXPECT_GT(seen.carried, 1000u);
  EXPECT_GT(seen.kept_recoveries, 200);
  EXPECT_GT(seen.last_frames, 500);
  EXPECT_GT(seen.answers, 500);
  EXPECT_GT(seen.resumed, 300);
  EXPECT_GT(seen.of_a_moved_world, 100);
  EXPECT_GT(seen.answers - seen.of_a_moved_world, 100);
  EXPECT_GT(seen.during_an_update, 200);
  EXPECT_GT(seen.declined, 100);
  EXPECT_GT(seen.local, 50);
}

}  // namespace
}  // namespace slambed
