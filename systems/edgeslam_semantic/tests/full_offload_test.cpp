// SPDX-License-Identifier: Apache-2.0
// ORB-SLAM and Mask-SLAM with everything on the edge, in virtual time on generated pictures.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "edgeslam_semantic/edgeslam_semantic.hpp"
#include "node/frame_file.hpp"
#include "node/tests/temporary_folder.hpp"
#include "node/virtual_run.hpp"
#include "synth/generator.hpp"
#include "wire/mask_codec.hpp"

namespace slambed {
namespace {

constexpr int kWidth = 320, kHeight = 240, kFps = 15, kFrames = 60;
constexpr double kSegment_ms = 150, kStage_ms = 4, kClosure_ms = 2;

struct Played {
  std::string text, trajectory;
  std::vector<nlohmann::json> events;  ///< of both nodes

  std::vector<nlohmann::json> of(const std::string& type) const {
    std::vector<nlohmann::json> found;
    for (const auto& event : events)
      if (event["type"] == type) found.push_back(event);
    return found;
  }
  int stages(const std::string& name) const {
    int count = 0;
    for (const auto& event : of("stage")) count += event["name"] == name;
    return count;
  }
};

class FullOffload : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared = std::make_unique<testing::TemporaryFolder>();
    synth::GeneratorOptions options;
    options.sensor = "mono";
    options.trajectory = "spline";
    options.seed = 2;
    options.width = kWidth;
    options.height = kHeight;
    options.fps = kFps;
    options.seconds = double(kFrames) / kFps;
    synth::generate(options, shared->path() / "sequence", 2, [](int, int) { return true; });
  }
  static void TearDownTestSuite() { shared.reset(); }

  static nlohmann::json params() {
    return {{"n_orb", 1000},         {"jpeg_quality", 90},   {"offload_window", 1},
            {"nrcc", false},         {"n_m", 0.8},           {"mask_border_px", 3},
            {"loop_closing", false}, {"second_hypotheses", false}};
  }

  /// Masks of every frame: something that moves covers all rows below `from_row`.
  void write_masks(int from_row) {
    const auto outside = static_cast<std::uint32_t>(kWidth * from_row);
    const Instance below{.object_class = 0,
                         .moves = true,
                         .score = 1,
                         .runs = {outside, kWidth * kHeight - outside},
                         .body = {}};
    FrameFile({"mask cache", 0x434D4C53, 1}, folder.path() / "m.masks", kFrames)
        .open_or_make("masks", [&](std::uint64_t) {
          return FrameFile::OwnedBlock{1, wire::encode_segmentation({kWidth, kHeight, {below}})};
        });
    world["mask_caches"] = {{{"n_m", 0.8}, {"path", folder.path() / "m.masks"}, {"key", "masks"}}};
  }

  Played play(const nlohmann::json& parameters) {
    const nlohmann::json playback{
        {"mode", "realtime"}, {"fps", nullptr}, {"start_s", 0.0}, {"end_s", nullptr}};
    folder.write("run.json",
                 nlohmann::json{{"format", "slambed-run"},
                                {"version", 1},
                                {"run_key", "offload"},
                                {"seed", 1},
                                {"system", "edgeslam_semantic"},
                                {"variant", "orbslam_offloaded"},
                                {"params", parameters},
                                {"sequence", shared->path() / "sequence"},
                                {"playback", playback},
                                {"network",
                                 {{"edge_address", "10.0.0.2"},
                                  {"ports", {{"control", 5000}, {"frame", 5001}}}}},
                                {"output", folder.path()},
                                {"connect_timeout_s", 1.0}}
                     .dump());
    folder.write("sim.json", world.dump());
    const System system = edgeslam_semantic_system();
    run_virtually(folder.path() / "sim.json", {&system, 1});
    Played played;
    for (const char* role : {"mobile", "edge"}) {
      const std::string text = testing::read_text(folder.path() / role / "events.jsonl");
      played.text += text;
      std::istringstream lines(text);
      for (std::string line; std::getline(lines, line);)
        played.events.push_back(nlohmann::json::parse(line));
    }
    played.trajectory = testing::read_text(folder.path() / "mobile" / "trajectory.txt");
    return played;
  }

  static nlohmann::json device(std::vector<std::string> stages) {
    nlohmann::json costs = nlohmann::json::object();
    for (const std::string& stage : stages)
      costs[stage] = {{"a_us", kStage_ms * 1000}, {"b_us", 0}, {"c_us", 0}, {"jitter", 0}};
    return {{"cores", 2}, {"speed", 1.0}, {"stages", costs}};
  }
  static nlohmann::json edge_device() {
    nlohmann::json edge = device({"decode_image", "extract", "track", "create_keyframe", "insert",
                                  "cull_points", "triangulate", "fuse", "bundle", "cull_keyframes",
                                  "cull_features", "loop_detect", "relocalise"});
    edge["stages"]["segment"] = {{"a_us", kSegment_ms * 1000}, {"b_us", 0}, {"c_us", 0},
                                 {"jitter", 0}, {"accelerator", "gpu"}};
    edge["accelerators"] = {{"gpu", {{"lanes", 1}, {"speed", 1.0}}}};
    return edge;
  }

  static std::unique_ptr<testing::TemporaryFolder> shared;
  testing::TemporaryFolder folder;
  nlohmann::json direction{{"delay_us", {5000}}};
  nlohmann::json world{
      {"format", "slambed-sim"},
      {"version", 1},
      {"run", "run.json"},
      {"devices", {{"mobile", device({"encode_image"})}, {"edge", edge_device()}}},
      {"link",
       {{"step_ms", 100}, {"interpolation", "linear"}, {"up", direction}, {"down", direction}}},
      {"edge_frozen_s", nlohmann::json::array()},
      {"feature_cache", nullptr}};
};
std::unique_ptr<testing::TemporaryFolder> FullOffload::shared;

TEST_F(FullOffload, EachFrameIsAnsweredAndItsPartsAddUp) {
  const Played run = play(params());
  const auto answers = run.of("frame_answered");
  ASSERT_GT(answers.size(), 20u);
  EXPECT_EQ(answers.size(), run.of("frame_sent").size());
  EXPECT_EQ(answers.size(), run.of("frame_tracked").size());
  for (const auto& frame : answers) {
    EXPECT_LE(frame["parts_error_ms"], kClosure_ms);
    EXPECT_GT(frame["latency_ms"], 10 + 3 * kStage_ms) << "two ways, decoding, extraction, tracking";
    EXPECT_EQ(frame["nrcc_ms"], 0.0);
  }
  EXPECT_EQ(run.stages("segment"), 0);
  EXPECT_GT(std::count(run.trajectory.begin(), run.trajectory.end(), '\n'), 20);
}

TEST_F(FullOffload, OneFrameAtATimeIsUnderWayAndTheNextIsTheNewest) {
  world["link"]["up"]["delay_us"] = {100'000};
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
  world["devices"]["edge"]["speed"] = 0.1;
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
  write_masks(0);  // all of the picture moves
  for (const auto& frame : play(masked).of("frame_tracked")) EXPECT_EQ(frame["features"], 0);
}

TEST_F(FullOffload, EqualRunsGiveEqualBytes) {
  const Played first = play(params());
  EXPECT_EQ(play(params()).text, first.text);
  world["image_cache"] = {{"path", folder.path() / "x.images"}, {"key", "images"}};
  world["feature_cache"] = {{"path", folder.path() / "x.features"}, {"key", "features"}};
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
  world["edge_frozen_s"] = {{1.5, 2.5}};
  const Played run = play(params());
  double longest = 0;
  for (const auto& frame : run.of("frame_answered"))
    longest = std::max(longest, frame["latency_ms"].get<double>());
  EXPECT_GT(longest, 900);
  EXPECT_GE(run.of("frame_answered").back()["frame"].get<int>(), kFrames - 3);
}

}  // namespace
}  // namespace slambed
