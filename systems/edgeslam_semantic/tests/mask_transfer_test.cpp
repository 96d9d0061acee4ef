// SPDX-License-Identifier: Apache-2.0
// Labels from a mask follow features from frame to frame.
#include <gtest/gtest.h>

#include <random>

#include "edgeslam_semantic/mask_transfer.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::edgeslam_semantic {
namespace {

constexpr int kCount = 60, kHalf = 320;
constexpr double kFrame_s = 1.0 / 30;

/// A grid of features with distinct descriptors. The features in the left half move right.
class Walk {
 public:
  Walk() : sensor_(wire::example_camera().make_sensor()) {
    std::mt19937_64 random(5);
    for (int i = 0; i < kCount; ++i)
      descriptors_.push_back({random(), random(), random(), random()});
  }

  /// hidden: index of a feature that is missing in this frame.
  std::shared_ptr<const FeatureSet> frame(int number, int hidden = -1) const {
    std::vector<KeyPoint> points;
    std::vector<Descriptor> descriptors;
    for (int i = 0; i < kCount; ++i) {
      if (i == hidden) continue;
      KeyPoint p;
      p.u = 30.0f + 60.0f * float(i % 10) + (walks(i) ? 2.0f * float(number) : 0.0f);
      p.v = 40.0f + 70.0f * float(i / 10);
      points.push_back(p);
      descriptors.push_back(descriptors_[i]);
    }
    return std::make_shared<FeatureSet>(sensor_, points, descriptors);
  }
  static constexpr bool walks(int i) { return i % 10 < 5; }

  /// The mask of frame 0: one person covers all moving features.
  FrameMasks left_half() const {
    Instance person{.object_class = 0, .moves = true, .score = 1, .runs = {}, .body = {}};
    person.runs = {0, kHalf};
    for (int row = 1; row < 480; ++row) person.runs.insert(person.runs.end(), {640 - kHalf, kHalf});
    person.runs.push_back(640 - kHalf);
    return {640, 480, {person}};
  }

 private:
  wire::SensorPtr sensor_;
  std::vector<Descriptor> descriptors_;
};

/// Takes frames 1/30 s apart unless told otherwise.
class Transfer : public MaskTransfer {
 public:
  explicit Transfer(const LabelOptions& labels, FeatureTrackOptions tracks = {})
      : MaskTransfer(labels, tracks) {}
  void track(std::shared_ptr<const FeatureSet> features, double after_s = kFrame_s) {
    time_s_ += after_s;
    MaskTransfer::track(std::move(features), time_s_);
  }

 private:
  double time_s_ = 0;
};

int labeled(const MaskTransfer& transfer) {
  return static_cast<int>(std::count(transfer.free().begin(), transfer.free().end(), 0));
}

TEST(MaskTransfer, ALateMaskLabelsTheFeaturesOfNow) {
  const Walk walk;
  Transfer transfer(LabelOptions{});
  transfer.track(walk.frame(0));
  transfer.keep_for_comparison(wire::keyframe_id(1));
  for (int n = 1; n <= 10; ++n) transfer.track(walk.frame(n));
  EXPECT_EQ(labeled(transfer), 0);
  EXPECT_EQ(transfer.matched(), kCount);
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  transfer.track(walk.frame(11));
  for (int i = 0; i < kCount; ++i) EXPECT_EQ(transfer.free()[i], Walk::walks(i) ? 0 : 1) << i;
  EXPECT_EQ(transfer.mask_age(), 11);
  const Labels labels = transfer.labels();
  EXPECT_EQ(
      std::count(labels.at(wire::keyframe_id(1)).begin(), labels.at(wire::keyframe_id(1)).end(), 1),
      kCount / 2);
}

TEST(MaskTransfer, AKeyframeIsKeptLongerThanLabelsLast) {
  const Walk walk;
  Transfer transfer({.frames = 300});
  transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(1));
  for (int n = 1; n <= 300; ++n) transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(2));
  EXPECT_TRUE(transfer.labels().contains(wire::keyframe_id(1)));
  for (int n = 301; n <= 331; ++n) transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(3));
  EXPECT_FALSE(transfer.labels().contains(wire::keyframe_id(1)));
  EXPECT_TRUE(transfer.labels().contains(wire::keyframe_id(2)));
}

TEST(MaskTransfer, AFeatureThatWasAwayForAMomentKeepsItsLabel) {
  const Walk walk;
  Transfer transfer({.neighbors = 0}, {.missing_frames = 3});
  transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(1));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  for (int n = 1; n <= 2; ++n) transfer.track(walk.frame(n));
  for (int n = 3; n <= 5; ++n) transfer.track(walk.frame(n, 0));
  transfer.track(walk.frame(6));
  EXPECT_EQ(transfer.free()[0], 0);
  for (int n = 7; n <= 10; ++n) transfer.track(walk.frame(n, 0));
  transfer.track(walk.frame(11));
  EXPECT_EQ(transfer.free()[0], 1) << "away for four frames: a track of its own";
}

TEST(MaskTransfer, AtFourFramesASecondLabelsReachAsFarAsAWalkerGetsMeanwhile) {
  constexpr int kApart = 24;  // the walkers move 48 px
  constexpr double kQuarter_s = 0.25;
  const Walk walk;
  for (const double after_s : {kQuarter_s, kFrame_s}) {
    Transfer transfer({.neighbors = 0});
    transfer.track(walk.frame(0));
    transfer.keep(wire::keyframe_id(1));
    ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
    transfer.track(walk.frame(kApart), after_s);
    EXPECT_EQ(labeled(transfer), after_s == kQuarter_s ? kCount / 2 : 0) << after_s;
    transfer.track(walk.frame(2 * kApart), after_s);
    EXPECT_EQ(labeled(transfer), after_s == kQuarter_s ? kCount / 2 : 0) << after_s;
  }
}

TEST(MaskTransfer, AFresherMaskSetsFreeAndAnOlderOneDoesNotWin) {
  const Walk walk;
  Transfer transfer(LabelOptions{});
  transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(1));
  transfer.track(walk.frame(1));
  transfer.keep(wire::keyframe_id(2));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(2), {640, 480, {}}));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  transfer.track(walk.frame(2));
  EXPECT_EQ(labeled(transfer), 0) << "the newer mask has nobody";
}

TEST(MaskTransfer, AFresherMaskSetsFree) {
  const Walk walk;
  Transfer transfer(LabelOptions{});
  transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(1));
  transfer.track(walk.frame(1));
  transfer.keep(wire::keyframe_id(2));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  EXPECT_EQ(labeled(transfer), kCount / 2);
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(2), {640, 480, {}}));
  transfer.track(walk.frame(2));
  EXPECT_EQ(labeled(transfer), 0);
}

constexpr int kWalker = 23, kStander = 26;
/// Large enough to reach the grid neighbors of these two features.
constexpr float kReach_px = 130;

TEST(MaskTransfer, AFeatureThatBeganLaterIsLabeledWhereTheMaskCoversTheFrameItsNeighborsCameFrom) {
  const Walk walk;
  for (const int late : {kWalker, kStander}) {
    Transfer transfer({.reach_px = kReach_px});
    transfer.track(walk.frame(0, late));
    transfer.keep(wire::keyframe_id(1));
    ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
    for (int n = 1; n <= 9; ++n) transfer.track(walk.frame(n, late));
    transfer.track(walk.frame(10));
    for (int i = 0; i < kCount; ++i) EXPECT_EQ(transfer.free()[i], Walk::walks(i) ? 0 : 1) << i;
  }
}

TEST(MaskTransfer, WithoutNeighborsAFeatureThatBeganLaterIsFree) {
  const Walk walk;
  Transfer transfer({.neighbors = 0});
  transfer.track(walk.frame(0, kWalker));
  transfer.keep(wire::keyframe_id(1));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  transfer.track(walk.frame(1));
  EXPECT_EQ(transfer.free()[kWalker], 1);
  EXPECT_EQ(labeled(transfer), kCount / 2 - 1);
}

TEST(MaskTransfer, ALateMaskReachesWhatBeganAndEndedMeanwhile) {
  const Walk walk;
  Transfer transfer({.reach_px = kReach_px}, {.missing_frames = 1});
  transfer.track(walk.frame(0, kWalker));
  transfer.keep(wire::keyframe_id(1));
  transfer.track(walk.frame(1));
  transfer.track(walk.frame(2));
  transfer.keep(wire::keyframe_id(2));
  for (int n = 3; n <= 9; ++n) transfer.track(walk.frame(n, kWalker));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  EXPECT_EQ(transfer.labels().at(wire::keyframe_id(2))[kWalker], 1);
}

TEST(MaskTransfer, WhatNeighborsSaidEndsWithAMaskThatHasNobody) {
  const Walk walk;
  Transfer transfer({.reach_px = kReach_px});
  transfer.track(walk.frame(0, kWalker));
  transfer.keep(wire::keyframe_id(1));
  transfer.track(walk.frame(1, kWalker));
  transfer.keep(wire::keyframe_id(2));
  transfer.track(walk.frame(2));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  EXPECT_EQ(transfer.free()[kWalker], 0);
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(2), {640, 480, {}}));
  transfer.track(walk.frame(3));
  EXPECT_EQ(labeled(transfer), 0);
}

TEST(MaskTransfer, LabelsEnd) {
  const Walk walk;
  Transfer transfer({.frames = 5});
  transfer.track(walk.frame(0));
  transfer.keep(wire::keyframe_id(1));
  ASSERT_TRUE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  for (int n = 1; n <= 5; ++n) transfer.track(walk.frame(n));
  EXPECT_EQ(labeled(transfer), kCount / 2);
  transfer.track(walk.frame(6));
  EXPECT_EQ(labeled(transfer), 0);
}

TEST(MaskTransfer, KeyFramesWhoseMasksNeverComeAreForgotten) {
  const Walk walk;
  Transfer transfer(LabelOptions{});
  for (int n = 0; n < 500; ++n) {
    transfer.track(walk.frame(n % 10));
    transfer.keep(wire::keyframe_id(static_cast<std::uint64_t>(n) + 1));
    ASSERT_LE(transfer.labels().size(), 151u) << n;
  }
  EXPECT_TRUE(transfer.apply(wire::keyframe_id(400), walk.left_half()));
  EXPECT_FALSE(transfer.apply(wire::keyframe_id(300), walk.left_half()));
}

TEST(MaskTransfer, KnowsNothingOfOtherKeyFrames) {
  const Walk walk;
  Transfer transfer(LabelOptions{});
  transfer.track(walk.frame(0));
  EXPECT_FALSE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
  transfer.keep(wire::keyframe_id(1));
  transfer.clear();
  EXPECT_FALSE(transfer.apply(wire::keyframe_id(1), walk.left_half()));
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
