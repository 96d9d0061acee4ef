// SPDX-License-Identifier: Apache-2.0
// The keyframe decision as a table with one row per outcome.
#include <gtest/gtest.h>

#include "slam/keyframe_rule.hpp"

namespace slambed {
namespace {

/// A well tracked frame that needs no keyframe; each row changes what it tests.
KeyFrameEvidence calm() {
  KeyFrameEvidence e;
  e.tracked = true;
  e.frames_since_keyframe = 10;
  e.keyframes = 20;
  e.inliers = 300;
  e.reference_matches = 350;
  e.close_tracked = 200;
  e.close_untracked = 50;
  return e;
}

struct Row {
  const char* name;
  void (*change)(KeyFrameEvidence&);
  KeyFrameNeed need;
  bool when_idle, when_busy, when_full;
};

const Row kRows[] = {
    {"calm", [](KeyFrameEvidence&) {}, KeyFrameNeed::kNone, false, false, false},
    {"not tracked", [](KeyFrameEvidence& e) { e.tracked = false, e.inliers = 100; },
     KeyFrameNeed::kNone, false, false, false},
    {"fewer than three quarters of the reference", [](KeyFrameEvidence& e) { e.inliers = 260; },
     KeyFrameNeed::kIfMapperAgrees, true, false, false},
    {"just three quarters", [](KeyFrameEvidence& e) { e.inliers = 300, e.reference_matches = 400; },
     KeyFrameNeed::kNone, false, false, false},
    {"... and a second since the last one",
     [](KeyFrameEvidence& e) { e.inliers = 260, e.frames_since_keyframe = 30; },
     KeyFrameNeed::kIfMapperAgrees, true, true, false},
    {"fewer than a quarter", [](KeyFrameEvidence& e) { e.inliers = 80; }, KeyFrameNeed::kUrgent,
     true, true, false},
    {"too few to build on", [](KeyFrameEvidence& e) { e.inliers = 15; }, KeyFrameNeed::kNone, false,
     false, false},
    {"close points wanted and there",
     [](KeyFrameEvidence& e) { e.close_tracked = 99, e.close_untracked = 71; },
     KeyFrameNeed::kUrgent, true, true, false},
    {"close points wanted but not there",
     [](KeyFrameEvidence& e) { e.close_tracked = 99, e.close_untracked = 70; }, KeyFrameNeed::kNone,
     false, false, false},
    {"a single keyframe asks for less",
     [](KeyFrameEvidence& e) { e.keyframes = 1, e.inliers = 150; }, KeyFrameNeed::kNone, false,
     false, false},
    {"a single keyframe, very few", [](KeyFrameEvidence& e) { e.keyframes = 1, e.inliers = 130; },
     KeyFrameNeed::kIfMapperAgrees, true, false, false},
    {"just relocalized in a grown map",
     [](KeyFrameEvidence& e) {
       e.inliers = 80, e.keyframes = 31, e.relocalized_ever = true,
       e.frames_since_relocalization = 29;
     },
     KeyFrameNeed::kNone, false, false, false},
    {"just relocalized in a young map",
     [](KeyFrameEvidence& e) {
       e.inliers = 80, e.keyframes = 30, e.relocalized_ever = true,
       e.frames_since_relocalization = 29;
     },
     KeyFrameNeed::kUrgent, true, true, false},
    {"relocalized a second ago",
     [](KeyFrameEvidence& e) {
       e.inliers = 80, e.keyframes = 31, e.relocalized_ever = true,
       e.frames_since_relocalization = 30;
     },
     KeyFrameNeed::kUrgent, true, true, false},
};

TEST(KeyFrameRule, Table) {
  const TrackerOptions options;
  for (const Row& row : kRows) {
    KeyFrameEvidence e = calm();
    row.change(e);
    EXPECT_EQ(keyframe_need(options, e), row.need) << row.name;
    EXPECT_EQ(wants_keyframe(options, e, {true, 0, true}), row.when_idle) << row.name;
    EXPECT_EQ(wants_keyframe(options, e, {false, 2, true}), row.when_busy) << row.name;
    EXPECT_EQ(wants_keyframe(options, e, {false, 3, true}), row.when_full) << row.name;
    EXPECT_FALSE(wants_keyframe(options, e, {true, 0, false})) << row.name;
  }
}

TEST(KeyFrameRule, YoungMapsTrustPointsSooner) {
  EXPECT_EQ(least_reference_weight({.keyframes = 2}), 2);
  EXPECT_EQ(least_reference_weight({.keyframes = 1}), 2);
  EXPECT_EQ(least_reference_weight({.metric = false, .keyframes = 1}), 1);
  EXPECT_EQ(least_reference_weight({.metric = false, .keyframes = 2}), 2);
  EXPECT_EQ(least_reference_weight({.keyframes = 3}), 3);
  EXPECT_EQ(least_reference_weight({.keyframes = 3, .unpredicted = true}), 2);
}

}  // namespace
}  // namespace slambed
