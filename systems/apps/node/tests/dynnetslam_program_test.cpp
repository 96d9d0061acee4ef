// SPDX-License-Identifier: Apache-2.0
// DynNetSLAM's nodes as processes while the edge dies, freezes, or its link changes.
#include <limits>
#include <map>

#include "apps/node/tests/far_edge.hpp"

namespace slambed {
namespace {

using testing::Process;
using namespace std::chrono_literals;

constexpr int kFrames = 180;  // 12 s
const std::vector<std::string> kChannels = {"control", "keyframe", "map", "frame", "handover"};

class DynNetSlamProgram : public testing::FarEdgeTest {
 protected:
  DynNetSlamProgram() : FarEdgeTest(kFrames, kChannels) {
    drop_no_frame();
    use("dynnetslam");
    config["params"].update({{"hysteresis", true},
                             {"safe_zone", false},
                             {"l_ol_ms", 400.0},
                             {"l_sz_ms", -1.0},
                             {"b_ms", 100.0},
                             {"rtt_source", "echo"},
                             {"mes_probe_hz", 10.0},
                             {"mes_probe_bytes", 64},
                             {"echo_hz", 20.0},
                             {"rtt_missing_s", 0.6},
                             {"decision_gap_s", 0.3}});
  }

  /// Returns the states in order, without a leading MES: that is the first decision if it comes
  /// before the edge's first answer.
  std::string states() {
    std::string text;
    for (const auto& event : events("mobile", "state_changed"))
      text.append(text.empty() ? "" : " ").append(event["to"].get<std::string>());
    return text.rfind("MES ", 0) == 0 ? text.substr(4) : text;
  }
  /// Returns whether the mobile's log, which lags by up to a second, has this state at any time
  /// after after_ns. Other states are allowed: on a slow machine even a near edge may answer late,
  /// so the mobile leaves it and returns.
  bool was_in(const std::string& state, std::int64_t after_ns) {
    const auto frames = events("mobile", "frame_tracked");
    const auto changes = events("mobile", "state_changed");
    for (std::size_t i = 0; i < changes.size(); ++i) {
      if (changes[i]["to"] != state) continue;
      if (i + 1 < changes.size() && changes[i + 1]["t_ns"] > after_ns) return true;
      if (i + 1 == changes.size() && !frames.empty() && frames.back()["t_ns"] > after_ns)
        return true;
    }
    return false;
  }
  bool await_state(const std::string& state, std::int64_t after_ns) {
    for (int i = 0; i < 2400; ++i) {
      if (was_in(state, after_ns)) return true;
      std::this_thread::sleep_for(50ms);
    }
    return false;
  }
  /// Waits until both nodes work together.
  void await_start() {
    ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json"))
        << log("mobile") << log("edge");
    start();
    ASSERT_TRUE(await_state("OS", 0)) << states();
    ASSERT_TRUE(await_event("edge", "keyframe_mapped"));
  }
  /// Expects that playback reached the end and both nodes ended in order.
  void expect_good_end(Process& mobile, Process& edge) {
    EXPECT_EQ(mobile.wait(), 0) << log("mobile");
    EXPECT_EQ(edge.wait(), 0) << log("edge");
    expect_parted_in_order();
  }
  void expect_parted_in_order() {
    EXPECT_EQ(end("mobile")["exit_reason"], "completed");
    EXPECT_EQ(end("edge")["exit_reason"], "bye");
    EXPECT_EQ(end("mobile")["frames_total"], frames_);
    EXPECT_TRUE(events("mobile", "track_lost").empty());
    expect_no_stale_update();
  }
  /// Expects that no update was applied after the end of the epoch in which it was sent.
  void expect_no_stale_update() {
    std::map<std::int64_t, std::int64_t> ended;
    for (const auto& event : events("mobile", "state_changed")) {
      if (event["to"] == "MES") ended[event["epoch"].get<std::int64_t>() - 1] = event["t_ns"];
    }
    std::map<std::int64_t, std::int64_t> epoch_of;  // by time applied, as update numbers can repeat
    const auto sent = events("edge", "update_sent");
    for (const auto& event : events("mobile", "update_applied")) {
      for (const auto& origin : sent) {
        if (origin["update"] != event["update"] || origin["t_ns"] > event["t_ns"]) continue;
        epoch_of[event["t_ns"].get<std::int64_t>()] = origin["epoch"].get<std::int64_t>();
      }
    }
    EXPECT_FALSE(epoch_of.empty()) << "no update was applied";
    for (const auto& [applied, epoch] : epoch_of) {
      if (ended.contains(epoch)) {
        EXPECT_LE(applied, ended[epoch]);
      }
    }
  }
  /// Returns the time from the edge's death until all channels to the next one were connected, or
  /// infinity if they never were. It may be long on a busy host.
  double without_edge_s(std::int64_t killed_ns) {
    std::map<std::string, std::int64_t> again;
    for (const auto& event : events_after(killed_ns, "mobile", "link"))
      if (event["event"] == "reconnected") again.emplace(event["channel"], event["t_ns"]);
    if (again.size() < kChannels.size()) return std::numeric_limits<double>::infinity();
    std::int64_t last_ns = 0;
    for (const auto& [channel, t_ns] : again) last_ns = std::max(last_ns, t_ns);
    return static_cast<double>(last_ns - killed_ns) / 1e9;
  }
  int keyframes_handed_over(std::int64_t after_ns) {
    int keyframes = 0;
    for (const auto& event : events_after(after_ns, "edge", "handover_applied"))
      keyframes += event["keyframes"].get<int>();
    return keyframes;
  }

  int frames_ = kFrames;  ///< frames that are played
};

TEST_F(DynNetSlamProgram, GoesToTheMobileSideAndBackWithTheLatency) {
  Process edge = edge_node(), mobile = node("mobile");
  ASSERT_NO_FATAL_FAILURE(await_start());
  for (const std::string state : {"MES", "OS", "MES"}) {
    const auto changed = now_ns();
    set_rtt(state == "MES" ? 1200ms : 4ms);
    ASSERT_TRUE(await_state(state, changed)) << states();
    std::this_thread::sleep_for(300ms);
  }
  set_rtt(4ms);
  expect_good_end(mobile, edge);
  EXPECT_FALSE(events("edge", "handover_applied").empty());
  EXPECT_FALSE(events("mobile", "keyframe_mapped").empty());
}

TEST_F(DynNetSlamProgram, AFrozenEdgeIsLeftAndJoinsAgain) {
  frames_ = play_for(10);
  Process edge = edge_node(), mobile = node("mobile");
  ASSERT_NO_FATAL_FAILURE(await_start());
  const auto frozen = now_ns();
  edge.signal(SIGSTOP);
  ASSERT_TRUE(await_state("MES", frozen)) << states();
  std::this_thread::sleep_for(1s);
  const auto thawed = now_ns();
  edge.signal(SIGCONT);
  ASSERT_TRUE(await_state("OS", thawed)) << states();
  expect_good_end(mobile, edge);
  EXPECT_GT(keyframes_handed_over(thawed), 0);
}

TEST_F(DynNetSlamProgram, AWayThatIsCutIsLeftAndTakenAgain) {
  frames_ = play_for(10);
  Process edge = edge_node(), mobile = node("mobile");
  ASSERT_NO_FATAL_FAILURE(await_start());
  const auto broken = now_ns();
  cut(true);
  ASSERT_TRUE(await_state("MES", broken)) << states();
  std::this_thread::sleep_for(1s);
  const auto mended = now_ns();
  cut(false);
  ASSERT_TRUE(await_state("OS", mended)) << states();
  expect_good_end(mobile, edge);
  EXPECT_GT(keyframes_handed_over(mended), 0);
}

TEST_F(DynNetSlamProgram, ARestartedEdgeGetsTheWholeMap) {
  frames_ = play_for(10);
  Process mobile = node("mobile");
  std::int64_t killed = 0;
  {
    Process edge = edge_node();
    ASSERT_NO_FATAL_FAILURE(await_start());
    killed = now_ns();
  }  // SIGKILL
  ASSERT_TRUE(await_state("MES", killed)) << states();
  const auto restarted = now_ns();
  Process edge = edge_node();
  ASSERT_TRUE(await_state("OS", restarted)) << states();
  expect_good_end(mobile, edge);
  const auto sent = events_after(restarted, "mobile", "handover_sent");
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(sent.front()["whole"], true);
  EXPECT_EQ(events("edge", "node_restarted").size(), 1u);
  EXPECT_GT(end("edge")["keyframes"].get<int>(), 0);
}

TEST_F(DynNetSlamProgram, AnEdgeRestartedAtOnceGetsTheMapWithoutAChangeOfState) {
  // The mobile believes that the edge has no map only this long after the first keyframe, and
  // leaves the edge only after this time without an answer.
  config["params"]["rtt_missing_s"] = 8.0;
  config["params"]["l_ol_ms"] = 60'000.0;  // late answers of a slow machine must not count
  constexpr double kAtOnceS = 5;
  std::int64_t killed = 0;
  int mobile_exit = 0, edge_exit = 0;
  for (int attempts = 3; attempts > 0; --attempts) {
    Process mobile = node("mobile");
    {
      Process edge = edge_node();
      ASSERT_NO_FATAL_FAILURE(await_start());
      killed = now_ns();
    }  // SIGKILL
    Process edge = edge_node();
    mobile_exit = mobile.wait();
    edge_exit = edge.wait();
    if (attempts == 1 || without_edge_s(killed) <= kAtOnceS) break;
    clear();  // a busy host restarted the edge too late for this test
  }
  ASSERT_LE(without_edge_s(killed), kAtOnceS) << log("mobile") << log("edge");
  EXPECT_EQ(mobile_exit, 0) << log("mobile");
  EXPECT_EQ(edge_exit, 0) << log("edge");
  expect_parted_in_order();
  EXPECT_EQ(states(), "OS");
  const auto applied = events_after(killed, "edge", "handover_applied");
  ASSERT_EQ(applied.size(), 1u);
  EXPECT_GT(applied[0]["keyframes"].get<int>(), 0);
}

TEST_F(DynNetSlamProgram, AnEdgeThatNeverComesBackChangesNothingForTracking) {
  frames_ = play_for(6);
  Process mobile = node("mobile");
  {
    Process edge = edge_node();
    ASSERT_NO_FATAL_FAILURE(await_start());
  }  // SIGKILL
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(end("mobile")["exit_reason"], "completed");
  EXPECT_EQ(end("mobile")["frames_total"], frames_);
  EXPECT_TRUE(events("mobile", "track_lost").empty());
  EXPECT_TRUE(states().ends_with("OS MES")) << states();
}

}  // namespace
}  // namespace slambed
