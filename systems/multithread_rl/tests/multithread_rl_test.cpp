// SPDX-License-Identifier: Apache-2.0
// The two nodes in virtual time on a synthetic scene: repeatable, and independent of this machine's
// timing.
#include "multithread_rl/multithread_rl.hpp"

#include <gtest/gtest.h>

#include <set>

#include "edgeslam/parameters.hpp"
#include "edgeslam/policies.hpp"
#include "offload/nodes/settings.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed {
namespace {

using testing::conventional;
using testing::PairLink;
using testing::PairResult;
using testing::turn;

constexpr int kStagedFrames = 90;

nlohmann::json switches(const std::string& map_update, const std::string& backup = "update",
                        const std::string& relocalization = "map") {
  auto params = conventional();
  params.update({{"map_update", map_update},
                 {"keyframe_backup", backup},
                 {"prior_map", ""},
                 {"relocalization", relocalization},
                 {"keep_recovery_keyframe", true},
                 {"reloc_fail_bytes", 75'000},
                 {"sync_period_s", 2.0},
                 {"fast_motion_ms", 0.0}});
  return params;
}

PairResult run_staged(const nlohmann::json& params, const PairLink& link = {},
                      int frames = kStagedFrames) {
  return testing::run_pair(multithread_rl_system(), params, frames, 10, link, turn);
}

/// Edge-SLAM as systems/edgeslam assembles it.
System edge_slam() {
  System system = offload_system("edgeslam", edgeslam::parameter_specs());
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamEdge>(node, parameters);
  };
  return system;
}

class BothCodecs : public ::testing::TestWithParam<const char*> {};

TEST_P(BothCodecs, WithBothSwitchesOffItIsConventionalEdgeSlam) {
  auto theirs = conventional(), ours = switches("serial");
  theirs.update(testing::ours());
  for (const char* same : {"sync_period_s", "fast_motion_ms"}) theirs[same] = ours[same];
  theirs["codec"] = ours["codec"] = GetParam();
  const PairLink link{.one_way_ms = {5}};
  const PairResult expected = testing::run_pair(edge_slam(), theirs, kStagedFrames, 10, link, turn);
  const PairResult result = run_staged(ours, link);
  ASSERT_FALSE(result.of("update_applied").empty());
  EXPECT_EQ(result.mobile_text, expected.mobile_text);
  EXPECT_EQ(result.edge_text, expected.edge_text);
  EXPECT_EQ(result.trajectory, expected.trajectory);
}

INSTANTIATE_TEST_SUITE_P(Codecs, BothCodecs, ::testing::Values("binary", "compatibility"));

double longest_pause_ms(const PairResult& result) {
  double longest = 0;
  for (const auto& update : result.of("update_applied"))
    longest = std::max(longest, update["pause_ms"].get<double>());
  return longest;
}

int sum_of(const PairResult& result, const char* field) {
  int sum = 0;
  for (const auto& update : result.of("update_applied")) sum += update.value(field, 0);
  return sum;
}

/// A mobile on which all stages of an update are slow.
DeviceModel slow_to_update() {
  DeviceModel device = testing::uniform_device(2000);
  for (const char* stage : {"parse", "insert_keyframes"}) device.stages[stage].a_us = 500'000;
  return device;
}

TEST(Multithread, TrackingGoesOnWhileAnUpdateIsWorkedIn) {
  PairLink link;
  link.mobile_device = slow_to_update();
  const PairResult serial = run_staged(switches("serial"), link),
                   staged = run_staged(switches("staged"), link);
  ASSERT_GE(serial.of("update_applied").size(), 2u);
  ASSERT_GE(staged.of("update_applied").size(), 1u);
  EXPECT_NEAR(longest_pause_ms(serial), 1006, 1);
  EXPECT_GT(serial.of("frame_dropped").size(), 4u);
  EXPECT_TRUE(staged.of("frame_dropped").empty() || staged.of("frame_dropped").size() < 4);
  EXPECT_TRUE(staged.of("track_lost").empty());
  EXPECT_EQ(staged.end_reason, "bye");
  std::set<std::string> names;
  for (const auto& stage : staged.of("stage")) {
    const std::string name = stage["name"], worker = stage["worker"];
    names.insert(name);
    if (name == "update_reference") {
      EXPECT_EQ(worker, "map-update");
    }
    if (name == "clean_map" || name == "update_last_frame") {
      EXPECT_EQ(worker, "tracking");
    }
    EXPECT_NE(name, "apply_update");
  }
  for (const char* name : {"update_reference", "clean_map", "update_last_frame"})
    EXPECT_TRUE(names.contains(name)) << name;
}

TEST(Multithread, AnUpdateEndsAlsoWhereKeyframesComeFasterThanTheyAreCarriedOver) {
  PairLink link;
  DeviceModel device = testing::uniform_device(2000);
  device.stages["insert_keyframes"] = {.b_us = 120'000};
  link.mobile_device = device;
  const PairResult result = run_staged(switches("staged"), link, 300);
  const auto begun = result.of("update_begun"), ready = result.of("update_ready"),
             applied = result.of("update_applied");
  ASSERT_GE(applied.size(), 2u);
  // Keyframes made during one round are left to the next, or to the swap if they are not fewer.
  int rounds = 0;
  for (const auto& stage : result.of("stage"))
    rounds += stage["name"] == "insert_keyframes" && stage["worker"] == "map-update";
  EXPECT_LE(rounds, 4 * static_cast<int>(begun.size()));
  for (std::size_t i = 0; i < ready.size(); ++i) {
    const double took_s = (ready[i]["t_ns"].get<double>() - begun[i]["t_ns"].get<double>()) / 1e9;
    EXPECT_LT(took_s, 14) << i;
  }
}

TEST(Multithread, CarriesOverWhatWasMadeMeanwhile) {
  PairLink link;
  link.mobile_device = slow_to_update();
  const PairResult none = run_staged(switches("staged", "none"), link);
  const PairResult backed_up = run_staged(switches("staged", "update"), link);
  const PairResult all = run_staged(switches("staged", "uncovered"), link);
  ASSERT_GE(none.of("update_applied").size(), 2u);
  EXPECT_EQ(sum_of(none, "backed_up"), 0);
  EXPECT_GT(sum_of(none, "gap_keyframes"), 0);
  EXPECT_GT(sum_of(backed_up, "backed_up"), 0);
  EXPECT_LT(sum_of(backed_up, "gap_keyframes"), sum_of(none, "gap_keyframes"));
  EXPECT_EQ(sum_of(all, "gap_keyframes"), 0);
}

/// Every keyframe made between an update's begin and its swap must be in tracking's final map.
TEST(Multithread, NoKeyframeMadeDuringAnUpdateIsMissing) {
  PairLink link;
  link.mobile_device = slow_to_update();
  const PairResult result = run_staged(switches("staged"), link);
  int made = 0, begun = 0, counted = 0;
  for (const auto& event : result.mobile) {
    const std::string type = event["type"];
    if (type == "update_received") begun = 1, made = 0;
    if (type == "update_declined") begun = 0;
    if (type == "keyframe_created" && begun) ++made;
    if (type == "update_applied") {
      // Some were made while the update was parsed, before update_received is logged.
      EXPECT_GE(event.value("backed_up", 0), made);
      counted += made;
      begun = 0;
    }
  }
  EXPECT_GT(counted, 0);
}

/// Playback ends between an update's begin and its swap.
TEST(Multithread, EndsInOrderWhileAnUpdateIsWorkedIn) {
  PairLink link;
  link.mobile_device = slow_to_update();
  const PairResult longer = run_staged(switches("staged"), link);
  ASSERT_FALSE(longer.of("update_begun").empty());
  const double begun_s = longer.of("update_begun")[0]["t_ns"].get<double>() / 1e9;
  const int frames = static_cast<int>(begun_s * 10) + 3;  // at 10 per second
  ASSERT_LT(frames, kStagedFrames);
  const PairResult result = run_staged(switches("staged"), link, frames);
  ASSERT_EQ(result.of("update_begun").size(), 1u);
  EXPECT_TRUE(result.of("update_applied").empty());
  EXPECT_EQ(result.of("frame_tracked").size(), static_cast<std::size_t>(frames));
  std::vector<std::string> byes;
  for (const auto& message : result.of("message"))
    if (message["message"] == "BYE") byes.push_back(message["direction"]);
  EXPECT_EQ(std::set<std::string>(byes.begin(), byes.end()), (std::set<std::string>{"up", "down"}));
  EXPECT_EQ(byes.size(), 2u);
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
}

TEST(Multithread, TheSameSeedGivesTheSameBytes) {
  PairLink link{.one_way_ms = {10}};
  link.mobile_device = slow_to_update();
  const PairResult first = run_staged(switches("staged"), link),
                   second = run_staged(switches("staged"), link);
  EXPECT_EQ(first.mobile_text, second.mobile_text);
  EXPECT_EQ(first.edge_text, second.edge_text);
  EXPECT_EQ(first.trajectory, second.trajectory);
}

TEST(Multithread, AMapForRelocalizationIsStagedToo) {
  const auto dark = [](testing::SyntheticScene& scene, int frame) {
    if (frame >= 100 && frame < 110) return scene.nothing();
    return turn(scene, frame < 100 ? frame : frame - 90);
  };
  auto params = switches("staged");
  params.update({{"n_kf", 1}, {"min_local_keyframes", 1}});
  const PairResult result = testing::run_pair(multithread_rl_system(), params, 200, 10, {}, dark);
  EXPECT_EQ(result.of("track_lost").size(), 1u);
  EXPECT_EQ(result.of("relocalized").size(), 1u);
  int begun = 0, applied = 0;
  for (const auto& update : result.of("update_begun")) begun += update["relocalization"] == true;
  for (const auto& update : result.of("update_applied"))
    applied += update["relocalization"] == true;
  EXPECT_GT(applied, 0);
  EXPECT_GE(begun, applied);
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "ok");
}

}  // namespace
}  // namespace slambed
