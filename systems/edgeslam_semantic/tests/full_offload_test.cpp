// SPDX-License-Identifier: Apache-2.0
// Fully offloaded ORB-SLAM and Mask-SLAM in virtual time on generated pictures.
#include <gtest/gtest.h>

#include "base/error.hpp"
#include "edgeslam_semantic/tests/semantic_run.hpp"

namespace slambed {
namespace {

class FullOffload : public SemanticRun {};

TEST_F(FullOffload, EachFrameIsAnsweredAndItsPartsAddUp) {
  const Played run = play(params());
  const auto answers = run.of("frame_answered");
  ASSERT_GT(answers.size(), 20u);
  EXPECT_EQ(answers.size(), run.of("frame_sent").size());
  EXPECT_EQ(answers.size(), run.of("frame_tracked").size());
  for (const auto& frame : answers) {
    EXPECT_LE(frame["parts_error_ms"], kClosure_ms);
    EXPECT_GT(frame["latency_ms"], 10 + 3 * kStage_ms)
        << "two ways, decoding, extraction, tracking";
    EXPECT_EQ(frame["nrcc_ms"], 0.0);
  }
  EXPECT_EQ(run.stages("segment"), 0);
  EXPECT_GT(std::count(run.trajectory.begin(), run.trajectory.end(), '\n'), 20);
}

TEST_F(FullOffload, OneFrameAtATimeIsUnderWayAndTheNextIsTheNewest) {
  scenario["link"]["up"]["delay_us"] = {100'000};
  const Played run = play(params());
  int under_way = 0, most = 0;
  std::vector<std::uint64_t> sent;
  for (const auto& event : run.events) {
    if (event["type"] == "frame_sent") {
      most = std::max(most, ++under_way);
      sent.push_back(event["frame"]);
    }
    if (event["type"] == "frame_answered") --under_way;
  }
  EXPECT_EQ(most, 1);
  ASSERT_GT(sent.size(), 10u);
  EXPECT_EQ(sent.size() + run.of("frame_dropped").size(), std::size_t{kFrames});
  EXPECT_GE(sent[5] - sent[4], 2u);
}

TEST_F(FullOffload, WithoutAWindowEveryFrameGoesAndAllComeLate) {
  scenario["devices"]["edge"]["speed"] = 0.1;
  auto every = params();
  every["offload_window"] = 0;
  const Played run = play(every);
  const auto answers = run.of("frame_answered");
  EXPECT_EQ(answers.size(), std::size_t{kFrames});
  EXPECT_TRUE(run.of("frame_dropped").empty());
  EXPECT_GT(answers.back()["latency_ms"].get<double>(),
            3 * answers.front()["latency_ms"].get<double>());
  for (const auto& frame : answers) EXPECT_LE(frame["parts_error_ms"], kClosure_ms);
}

TEST_F(FullOffload, EveryPictureIsSegmentedAndNothingUnderAMaskIsTracked) {
  const Played free = play(params());
  write_masks(kHeight / 2);
  auto masked = params();
  masked["nrcc"] = true;
  const Played run = play(masked);
  const auto answers = run.of("frame_answered");
  ASSERT_GT(answers.size(), 5u);
  EXPECT_EQ(run.stages("segment"), static_cast<int>(answers.size()));
  for (const auto& frame : answers) {
    EXPECT_LE(frame["parts_error_ms"], kClosure_ms);
    EXPECT_GE(frame["nrcc_ms"], kSegment_ms);
    EXPECT_GE(frame["inference_ms"].get<double>(), kSegment_ms + kStage_ms);
    EXPECT_EQ(frame["instances"], 1);
  }
  const auto features = [](const Played& played) {
    return played.of("frame_tracked").front()["features"].get<int>();
  };
  EXPECT_LT(features(run), features(free));
  EXPECT_GT(features(run), 0);
  write_masks(0);
  std::filesystem::remove(folder.path() / "m.masks");
  write_masks(0);  // the mask covers the whole picture
  for (const auto& frame : play(masked).of("frame_tracked")) EXPECT_EQ(frame["features"], 0);
}

TEST_F(FullOffload, EqualRunsGiveEqualBytes) {
  const Played first = play(params());
  EXPECT_EQ(play(params()).text, first.text);
  scenario["image_cache"] = {{"path", folder.path() / "x.images"}, {"key", "images"}};
  scenario["feature_cache"] = {{"path", folder.path() / "x.features"}, {"key", "features"}};
  EXPECT_EQ(play(params()).text, first.text) << "with the caches, made now";
  EXPECT_EQ(play(params()).text, first.text) << "with the caches, read";
}

TEST_F(FullOffload, WhatTheEdgeSeesIsThePictureAsItWasCoded) {
  auto coarse = params();
  coarse["jpeg_quality"] = 15;
  const Played fine_run = play(params()), coarse_run = play(coarse);
  EXPECT_LT(coarse_run.of("frame_sent").front()["jpeg_bytes"].get<int>() * 2,
            fine_run.of("frame_sent").front()["jpeg_bytes"].get<int>());
  EXPECT_NE(coarse_run.trajectory, fine_run.trajectory);
}

TEST_F(FullOffload, ANodeWithoutSegmentationSaysSo) {
  auto masked = params();
  masked["nrcc"] = true;
  try {
    play(masked);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("nothing segments the pictures"), std::string::npos);
  }
}

TEST_F(FullOffload, GoesOnWhenTheEdgeStoodStill) {
  scenario["edge_frozen_s"] = {{1.5, 2.5}};
  const Played run = play(params());
  double longest = 0;
  for (const auto& frame : run.of("frame_answered"))
    longest = std::max(longest, frame["latency_ms"].get<double>());
  EXPECT_GT(longest, 900);
  EXPECT_GE(run.of("frame_answered").back()["frame"].get<int>(), kFrames - 3);
}

}  // namespace
}  // namespace slambed
