// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/tests/temporary_folder.hpp"
#include "edgeslam_semantic/edgeslam_semantic.hpp"
#include "run/virtual_run.hpp"
#include "sequence/frame_file.hpp"
#include "synth/generator.hpp"
#include "wire/mask_codec.hpp"

namespace slambed {

inline constexpr int kWidth = 320, kHeight = 240, kFps = 15, kFrames = 60;
inline constexpr double kSegment_ms = 150, kStage_ms = 4, kClosure_ms = 2;

struct Played {
  std::string text, trajectory;
  std::vector<nlohmann::json> events;  ///< of both nodes

  /// Adds the log of one node.
  void add(const std::string& log) {
    text += log;
    std::istringstream lines(log);
    for (std::string line; std::getline(lines, line);)
      events.push_back(nlohmann::json::parse(line));
  }
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

/// Plays variants of the system in virtual time on four seconds of a generated sequence.
class SemanticRun : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared = std::make_unique<testing::TemporaryFolder>();
    generate({}, shared->path() / "sequence");
  }
  static void generate(const synth::SensorOptions& sensor, const std::filesystem::path& where,
                       int frames = kFrames) {
    synth::GeneratorOptions options;
    options.sensor = "mono";
    options.trajectory = "spline";
    options.seed = 2;
    options.width = kWidth;
    options.height = kHeight;
    options.fps = kFps;
    options.seconds = double(frames) / kFps;
    options.sensor_model = sensor;
    synth::generate(options, where, 2, [](int, int) { return true; });
  }
  static void TearDownTestSuite() { shared.reset(); }

  static nlohmann::json params() {
    return {{"n_orb", 1000},
            {"jpeg_quality", 90},
            {"offload_window", 1},
            {"picture_queue", 900},
            {"nrcc", false},
            {"n_m", 0.8},
            {"mask_border_px", 3},
            {"nrcc_floor_ms", 150.0},
            {"loop_closing", false},
            {"second_hypotheses", false},
            {"full_offload", true},
            {"adapt", false},
            {"fixed_row", 0},
            {"table_n_m", "0.8 0.7 0.6"},
            {"delay_one_way", true},
            {"probe_period_s", 1.0},
            {"keyframes_under_way", 2},
            {"upload_queue", 8},
            {"local_references", true},
            {"local_keyframes", 10},
            {"local_neighbors", 5},
            {"label_frames", 120},
            {"label_neighbors", 3},
            {"label_reach_px", 50.0},
            {"record_culling", false}};
  }

  /// Writes masks for every frame: one moving instance covers all rows from `from_row` down.
  void write_masks(int from_row, int frames = kFrames) {
    const auto outside = static_cast<std::uint32_t>(kWidth * from_row);
    const Instance below{.object_class = 0,
                         .moves = true,
                         .score = 1,
                         .runs = {outside, kWidth * kHeight - outside},
                         .body = {}};
    FrameFile({"mask cache", 0x434D4C53, 1}, folder.path() / "m.masks", frames)
        .open_or_make("masks", [&](std::uint64_t) {
          return FrameFile::OwnedBlock{1, wire::encode_segmentation({kWidth, kHeight, {below}})};
        });
    scenario["mask_caches"] = nlohmann::json::array();
    for (const double n_m : {0.8, 0.7, 0.6})
      scenario["mask_caches"].push_back(
          {{"n_m", n_m}, {"path", folder.path() / "m.masks"}, {"key", "masks"}});
  }

  void write_scenario(const nlohmann::json& parameters, bool with_edge = true) {
    const nlohmann::json playback{
        {"mode", "realtime"}, {"fps", nullptr}, {"start_s", 0.0}, {"end_s", nullptr}};
    const nlohmann::json network{
        {"edge_address", "10.0.0.2"},
        {"ports", {{"control", 5000}, {"frame", 5001}, {"mask", 5002}, {"probe", 5003}}}};
    folder.write("run.json", nlohmann::json{{"format", "slambed-run"},
                                            {"version", 1},
                                            {"run_key", "offload"},
                                            {"seed", 1},
                                            {"system", "edgeslam_semantic"},
                                            {"variant", "orbslam_offloaded"},
                                            {"params", parameters},
                                            {"sequence", sequence},
                                            {"playback", playback},
                                            {"network", with_edge ? network : nlohmann::json()},
                                            {"output", folder.path()},
                                            {"connect_timeout_s", 1.0}}
                                 .dump());
    folder.write("sim.json", scenario.dump());
  }

  Played play(const nlohmann::json& parameters) {
    write_scenario(parameters);
    const System system = edgeslam_semantic_system();
    run_virtually(folder.path() / "sim.json", {&system, 1});
    Played played;
    for (const char* role : {"mobile", "edge"})
      played.add(testing::read_text(folder.path() / role / "events.jsonl"));
    played.trajectory = testing::read_text(folder.path() / "mobile" / "trajectory.txt");
    return played;
  }

  static nlohmann::json device(std::vector<std::string> stages) {
    nlohmann::json costs = nlohmann::json::object();
    for (const std::string& stage : stages)
      costs[stage] = {{"a_us", kStage_ms * 1000}, {"b_us", 0}, {"c_us", 0}, {"jitter", 0}};
    return {{"cores", 2}, {"speed", 1.0}, {"stages", costs}};
  }
  static nlohmann::json mobile_device() {
    return device({"encode_image", "extract", "match_features", "cull_features", "track",
                   "relocalize", "create_keyframe", "insert", "cull_points", "triangulate",
                   "serialize", "parse", "apply_update"});
  }
  static nlohmann::json edge_device() {
    nlohmann::json edge =
        device({"parse", "prepare_update", "serialize", "decode_image", "extract", "track",
                "create_keyframe", "insert", "cull_points", "triangulate", "fuse", "bundle",
                "cull_keyframes", "cull_features", "loop_detect", "relocalize"});
    edge["stages"]["segment"] = {{"a_us", kSegment_ms * 1000},
                                 {"b_us", 0},
                                 {"c_us", 0},
                                 {"jitter", 0},
                                 {"accelerator", "gpu"}};
    edge["accelerators"] = {{"gpu", {{"lanes", 1}, {"speed", 1.0}}}};
    return edge;
  }

  static inline std::unique_ptr<testing::TemporaryFolder> shared;
  testing::TemporaryFolder folder;
  std::filesystem::path sequence = shared->path() / "sequence";
  nlohmann::json direction{{"delay_us", {5000}}};
  nlohmann::json scenario{
      {"format", "slambed-sim"},
      {"version", 1},
      {"run", "run.json"},
      {"devices", {{"mobile", mobile_device()}, {"edge", edge_device()}}},
      {"link",
       {{"step_ms", 100}, {"interpolation", "linear"}, {"up", direction}, {"down", direction}}},
      {"edge_frozen_s", nlohmann::json::array()},
      {"feature_cache", nullptr}};
};

}  // namespace slambed
