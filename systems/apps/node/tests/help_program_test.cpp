// SPDX-License-Identifier: Apache-2.0
// Runs multithread_rl and cloudslam, whose edge answers with poses, as processes.
#include <algorithm>
#include <cmath>
#include <vector>

#include "apps/node/tests/node_program.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;
using testing::Process;

constexpr double kSeconds = 9, kDark_s = 6, kLight_s = 6.5;

/// A generated sequence in a room in which the lens is covered for half a second.
const fs::path& room() {
  static const testing::TemporaryFolder folder;
  static const fs::path path = [] {
    const fs::path made = folder.path() / "sequence";
    synth::GeneratorOptions options;
    options.width = 320;
    options.height = 240;
    options.fps = testing::kFps;
    options.seconds = kSeconds;
    options.sensor_model.blackout_start_s = kDark_s;
    options.sensor_model.blackout_end_s = kLight_s;
    synth::generate(options, made, 2, [](int, int) { return true; });
    return made;
  }();
  return path;
}

class HelpProgram : public testing::NodeProgramTest {
 protected:
  HelpProgram() : NodeProgramTest(1) {
    config["sequence"] = room();
    drop_no_frame();
  }

  /// Runs both nodes and expects that they end in order.
  void run_both() {
    Process edge = node("edge"), mobile = node("mobile");
    ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json"))
        << log("mobile") << log("edge");
    start();
    ASSERT_EQ(mobile.wait(), 0) << log("mobile");
    ASSERT_EQ(edge.wait(), 0) << log("edge");
    EXPECT_EQ(end("mobile")["exit_reason"], "completed");
    EXPECT_EQ(end("edge")["exit_reason"], "bye");
    for (const char* role : {"mobile", "edge"}) EXPECT_TRUE(events(role, "warning").empty());
  }
};

class MultithreadRlProgram : public HelpProgram, public ::testing::WithParamInterface<const char*> {
 protected:
  MultithreadRlProgram() {
    use("multithread_rl");
    config["params"].update({{"keep_recovery_keyframe", true},
                             {"reloc_fail_bytes", 75'000},
                             {"keyframe_backup", "update"},
                             {"prior_map", ""}});
  }
};

TEST_P(MultithreadRlProgram, UpdatesAreTakenOverAndALossEnds) {
  const std::string variant = GetParam();
  config["params"]["map_update"] = variant == "relocate" ? "serial" : "staged";
  config["params"]["relocalization"] = variant == "multithread" ? "map" : "edge";
  run_both();
  EXPECT_EQ(events("mobile", "track_lost").size(), 1u);
  EXPECT_EQ(events("mobile", "relocalized").size(), 1u);
  EXPECT_EQ(events("mobile", "frame_tracked").back()["state"], "ok");
  EXPECT_GT(events("mobile", "update_applied").size(), 0u);
  for (const auto& update : events("mobile", "update_applied")) EXPECT_GE(update["pause_ms"], 0);
  const bool asks = variant != "multithread";
  EXPECT_EQ(events("mobile", "suspended").size(), asks ? 1u : 0u);
  EXPECT_EQ(events("mobile", "reloc_request").empty(), !asks);
  // A node that is preempted between two timestamps of one moment counts that time twice. Parts
  // that do not add up would show in every answer, so the smallest error is checked.
  std::vector<double> errors;
  for (const auto& reply : events("mobile", "reloc_reply")) {
    if (!reply.contains("total_ms")) continue;
    double sum = 0;
    for (const char* part : {"request_ms", "up_ms", "edge_ms", "down_ms", "boundary_ms"})
      sum += reply[part].get<double>();
    errors.push_back(std::abs(sum - reply["total_ms"].get<double>()));
  }
  ASSERT_EQ(errors.empty(), !asks);
  if (!asks) return;
  EXPECT_LE(*std::min_element(errors.begin(), errors.end()), 2);
}

INSTANTIATE_TEST_SUITE_P(Variants, MultithreadRlProgram,
                         ::testing::Values("multithread", "relocate", "multithread_rl"),
                         [](const auto& variant) { return std::string(variant.param); });

class CloudSlamProgram : public HelpProgram {
 protected:
  /// Makes the prior map by a first trip before the lens is covered.
  fs::path first_trip() {
    const auto second = config;
    use_orbslam2();
    config["params"]["save_map"] = true;
    config["params"]["sequential"] = true;
    play_for(kDark_s);
    const fs::path map = folder.path() / "first.slm";
    start();
    Process mobile = node("mobile");
    EXPECT_EQ(mobile.wait(), 0) << log("mobile");
    fs::rename(folder.path() / "mobile" / "map.slm", map);
    fs::remove_all(folder.path() / "mobile");
    fs::remove(folder.path() / "start.json");
    config = second;
    return map;
  }

  void drive(const std::string& strategy) {
    const fs::path map = first_trip();
    config["system"] = "cloudslam";
    config["network"]["ports"] = {{"control", config["network"]["ports"]["control"]},
                                  {"keyframe", config["network"]["ports"]["keyframe"]},
                                  {"upload", config["network"]["ports"]["map"]}};
    config["params"] = {{"n_orb", 600},
                        {"strategy", strategy},
                        {"period_s", 1.0},
                        {"distance_m", 0.1},
                        {"correction_threshold_m", 0.01},
                        {"decrease", 0.9},
                        {"increase", 1.01},
                        {"distance_min_m", 0.01},
                        {"distance_max_m", 500.0},
                        {"window_s", 2.0},
                        {"back_propagation", "graded"},
                        {"bundle_keyframes", 10},
                        {"align_rate_hz", 2.0},
                        {"align_timeout_s", 5.0},
                        {"prior_map", map},
                        {"search_radius_m", 1.0},
                        {"place_candidates", 5},
                        {"near_candidates", 5},
                        {"remote_queue", 8},
                        {"keyframe_queue", 8},
                        {"keyframe_bytes", 100'000},
                        {"codec", "binary"},
                        {"upload", true},
                        {"second_hypotheses", true}};
    play_for(kDark_s);
    run_both();
    EXPECT_EQ(events("mobile", "trip_aligned").size(), 1u);
    EXPECT_GT(events("mobile", "pose_update_applied").size(), 1u);
    EXPECT_TRUE(events("mobile", "track_lost").empty());
    EXPECT_TRUE(fs::exists(folder.path() / "edge" / "cloud_map.slm"));
  }
};

TEST_F(CloudSlamProgram, ATripIsPlacedAndCorrectedByDistance) { drive("distance"); }
TEST_F(CloudSlamProgram, ATripIsPlacedAndCorrectedByTheClock) { drive("periodic"); }

}  // namespace
}  // namespace slambed
