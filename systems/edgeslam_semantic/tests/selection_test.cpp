// SPDX-License-Identifier: Apache-2.0
// Keyframe selection, rows of Table I, and the link's delay estimate.
#include <gtest/gtest.h>

#include "edgeslam_semantic/configuration.hpp"
#include "edgeslam_semantic/link_delay.hpp"

namespace slambed::edgeslam_semantic {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(TableI, HasThePapersRows) {
  const struct {
    int f_min, f_max;
    double alpha, beta;
    int levels;
    double n_m;
  } printed[] = {{10, 40, 0.3, 0.9, 8, 0.8},
                 {20, 50, 0.3, 0.9, 6, 0.8},
                 {20, 60, 0.4, 0.9, 6, 0.8},
                 {30, 70, 0.5, 0.8, 4, 0.7},
                 {40, 80, 0.5, 0.7, 4, 0.6}};
  for (int row = 1; row <= kRows; ++row) {
    const auto& wanted = printed[row - 1];
    const Configuration& found = table_row(row);
    EXPECT_EQ(found.f_min, wanted.f_min) << row;
    EXPECT_EQ(found.f_max, wanted.f_max) << row;
    EXPECT_EQ(found.alpha, wanted.alpha) << row;
    EXPECT_EQ(found.beta, wanted.beta) << row;
    EXPECT_EQ(found.levels, wanted.levels) << row;
    EXPECT_EQ(found.n_m, wanted.n_m) << row;
  }
}

TEST(TableI, RowsFollowTheDelayWithClosedUpperEnds) {
  const struct {
    double n_ms;
    int row;
  } cases[] = {{0, 1},  {5, 1},  {10, 1},     {10.001, 2}, {15, 2},  {15.001, 3}, {35, 3},
               {36, 4}, {50, 4}, {50.001, 5}, {299, 5},    {300, 5}, {5000, 5}};
  for (const auto& one : cases)
    EXPECT_EQ(row_for(from_seconds(one.n_ms / 1000)), one.row) << one.n_ms;
  EXPECT_EQ(row_for(std::nullopt), 3) << "nothing is known of the link: the paper's defaults";
}

/// A frame that only just meets all conditions of the paper's defaults (row 3).
FrameFacts due() {
  return {.frames_since_keyframe = 21,
          .keyframes = 20,
          .frames_since_optimization = 59,
          .features = 400,
          .keyframe_features = 1000,
          .matched = 900};
}

TEST(SelectKeyFrame, NeedsAllFourConditions) {
  const Configuration& row = table_row(3);
  EXPECT_EQ(select_keyframe(row, due()), Selection::kByRule);
  FrameFacts too_soon = due();
  too_soon.frames_since_keyframe = 20;
  EXPECT_EQ(select_keyframe(row, too_soon), Selection::kNo) << "1: more than f_min frames";
  too_soon.keyframes = 19;
  EXPECT_EQ(select_keyframe(row, too_soon), Selection::kByRule) << "1: a young map";
  FrameFacts stale = due();
  stale.frames_since_optimization = 60;
  EXPECT_EQ(select_keyframe(row, stale), Selection::kNo) << "2: fewer than f_max frames";
  FrameFacts poor = due();
  poor.features = 399;
  EXPECT_EQ(select_keyframe(row, poor), Selection::kNo) << "3: alpha of the features";
  FrameFacts alike = due();
  alike.matched = 901;
  EXPECT_EQ(select_keyframe(row, alike), Selection::kNo) << "4: at most beta matched";
}

/// Figure 10: a frame is no keyframe if 90 % or more match, and is one if fewer than 80 % do.
TEST(SelectKeyFrame, JudgesThePapersExamples) {
  for (const int row : {3, 4}) {
    FrameFacts frame = due();
    frame.frames_since_keyframe = 50;
    frame.keyframes = 100;
    frame.features = 1000;
    frame.matched = 910;
    EXPECT_EQ(select_keyframe(table_row(row), frame), Selection::kNo) << row;
    frame.matched = 790;
    EXPECT_EQ(select_keyframe(table_row(row), frame), Selection::kByRule) << row;
  }
}

TEST(SelectKeyFrame, ForcesOneWhereResultsAreLost) {
  const Configuration& row = table_row(1);
  FrameFacts frame = due();
  frame.frames_since_optimization = frame.frames_since_keyframe = 2 * row.f_max;
  frame.matched = frame.keyframe_features;  // no other condition selects it
  EXPECT_EQ(select_keyframe(row, frame), Selection::kForced);
  --frame.frames_since_optimization;
  EXPECT_EQ(select_keyframe(row, frame), Selection::kNo);
}

void send(LinkDelay& link, std::uint64_t sequence, std::size_t bytes, RunTime when) {
  link.going(bytes, when);
  link.numbered(sequence);
}

TEST(LinkDelay, IsUnknownUntilAProbeAndAnUploadCameBack) {
  LinkDelay link(true);
  EXPECT_FALSE(link.delay());
  send(link, 1, 100'000, milliseconds(0));
  link.probed(milliseconds(16));
  EXPECT_FALSE(link.delay());
  EXPECT_EQ(link.mean_bytes(), 100'000);
  link.acknowledged(1, milliseconds(32));
  ASSERT_TRUE(link.delay());
}

TEST(LinkDelay, AddsHalfTheRoundTripAndTheTimeOfAnUpload) {
  LinkDelay link(true), whole(false);
  for (LinkDelay* one : {&link, &whole}) {
    one->probed(milliseconds(16));
    send(*one, 1, 100'000, milliseconds(100));
    one->acknowledged(1, milliseconds(132));  // a round trip and 16 ms of transmission
  }
  EXPECT_NEAR(to_seconds(*link.delay()), 0.008 + 0.016, 1e-6);
  EXPECT_NEAR(to_seconds(*whole.delay()), 0.016 + 0.016, 1e-6);
  EXPECT_NEAR(*link.bytes_per_s(), 100'000 / 0.016, 1);
}

TEST(LinkDelay, CountsUploadsBehindOneAnotherByTheTimeBetweenTheirAnswers) {
  LinkDelay link(true);
  link.probed(milliseconds(10));
  send(link, 1, 50'000, milliseconds(0));
  send(link, 2, 50'000, milliseconds(1));
  link.acknowledged(1, milliseconds(30));  // a round trip and 20 ms of transmission
  link.acknowledged(2, milliseconds(50));  // 20 ms of transmission
  EXPECT_NEAR(*link.bytes_per_s(), 50'000 / 0.020, 1);
  link.acknowledged(2, milliseconds(500));
  link.acknowledged(99, milliseconds(500));
  EXPECT_NEAR(*link.bytes_per_s(), 50'000 / 0.020, 1) << "repeated or unknown";
}

TEST(LinkDelay, AnAnswerMayComeBeforeItsUploadHasANumber) {
  LinkDelay link(true);
  link.probed(milliseconds(10));
  link.acknowledged(1, milliseconds(0));
  link.going(50'000, milliseconds(1));
  link.acknowledged(2, milliseconds(31));
  EXPECT_FALSE(link.bytes_per_s());
  link.numbered(2);
  ASSERT_TRUE(link.bytes_per_s());
  EXPECT_NEAR(*link.bytes_per_s(), 50'000 / 0.020, 1);
  link.going(50'000, milliseconds(40));
  link.numbered(3);
  link.acknowledged(3, milliseconds(70));
  EXPECT_NEAR(*link.bytes_per_s(), 50'000 / 0.020, 1) << "behind nothing";
}

TEST(LinkDelay, TakesTheMeanOfTheLastFiveUploads) {
  LinkDelay link(true);
  for (std::uint64_t i = 1; i <= 7; ++i) send(link, i, 1000 * i, milliseconds(i));
  EXPECT_EQ(link.mean_bytes(), 5000);
}

TEST(LinkDelay, SmoothsTheRoundTripByEighths) {
  LinkDelay link(true);
  link.probed(milliseconds(8));
  link.probed(milliseconds(16));
  EXPECT_EQ(*link.round_trip(), microseconds(9000));
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
