// SPDX-License-Identifier: Apache-2.0
// DynNetSLAM's nodes as processes while the edge dies, freezes, or the way to it changes.
#include <map>
#include <memory>

#include "programs/tests/forwarder.hpp"
#include "programs/tests/node_program.hpp"

namespace slambed {
namespace {

using testing::Forwarder;
using testing::Process;
using namespace std::chrono_literals;

constexpr int kFrames = 180;  // 12 s
const std::vector<std::string> kChannels = {"control", "keyframe", "map", "frame", "handover"};

class DynNetSlamProgram : public testing::NodeProgramTest {
 protected:
  DynNetSlamProgram() : NodeProgramTest(kFrames) {
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
    const auto ports = testing::free_ports(2 * static_cast<int>(kChannels.size()));
    for (std::size_t i = 0; i < kChannels.size(); ++i) {
      const int near = ports[2 * i], far = ports[2 * i + 1];
      config["network"]["ports"][kChannels[i]] = near;
      far_ports_[kChannels[i]] = far;
      way_.push_back(std::make_unique<Forwarder>(near, far));
      EXPECT_TRUE(way_.back()->ready());
    }
  }

  /// The edge listens at the far end of the way.
  Process edge_node() {
    auto far = config;
    for (const auto& [channel, port] : far_ports_) far["network"]["ports"][channel] = port;
    const auto path = folder.write("edge.json", far.dump());
    return Process({SLAMBED_NODE, "--role", "edge", "--config", path}, folder.path() / "edge.log");
  }
  void set_rtt(std::chrono::milliseconds rtt) {
    for (auto& channel : way_) channel->set_one_way(rtt / 2);
  }
  void cut(bool is_cut) {
    for (auto& channel : way_) channel->cut(is_cut);
  }
  /// The states in their order, from the first OS on: the first decision may come before the first
  /// answer of the edge, and is MES then.
  std::string states() {
    std::string text;
    for (const auto& event : events("mobile", "state_changed"))
      text.append(text.empty() ? "" : " ").append(event["to"].get<std::string>());
    return text.rfind("MES ", 0) == 0 ? text.substr(4) : text;
  }
  /// Until the mobile's log tells these states, which follows them by up to a second.
  void await_states(const std::string& expected) {
    for (int i = 0; i < 2400 && states() != expected; ++i) std::this_thread::sleep_for(50ms);
    ASSERT_EQ(states(), expected);
  }
  /// Until both have begun to work with each other.
  void await_start() {
    ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json"))
        << log("mobile") << log("edge");
    start();
    await_states("OS");
    ASSERT_TRUE(await_event("edge", "keyframe_mapped"));
  }
  /// Playback went on to the end, and both parted in order.
  void expect_good_end(Process& mobile, Process& edge) {
    EXPECT_EQ(mobile.wait(), 0) << log("mobile");
    EXPECT_EQ(edge.wait(), 0) << log("edge");
    EXPECT_EQ(end("mobile")["exit_reason"], "completed");
    EXPECT_EQ(end("edge")["exit_reason"], "bye");
    EXPECT_EQ(end("mobile")["frames_total"], frames_);
    EXPECT_TRUE(events("mobile", "track_lost").empty());
    expect_no_stale_update();
  }
  /// Nothing that was sent in an epoch was taken over after it.
  void expect_no_stale_update() {
    std::map<std::int64_t, std::int64_t> ended;
    for (const auto& event : events("mobile", "state_changed")) {
      if (event["to"] == "MES") ended[event["epoch"].get<std::int64_t>() - 1] = event["t_ns"];
    }
    std::map<std::int64_t, std::int64_t> epoch_of;  // by time of sending: numbers can come again
    const auto sent = events("edge", "update_sent");
    for (const auto& event : events("mobile", "update_applied")) {
      for (const auto& origin : sent) {
        if (origin["update"] != event["update"] || origin["t_ns"] > event["t_ns"]) continue;
        epoch_of[event["t_ns"].get<std::int64_t>()] = origin["epoch"].get<std::int64_t>();
      }
    }
    for (const auto& [applied, epoch] : epoch_of) {
      if (ended.contains(epoch)) {
        EXPECT_LE(applied, ended[epoch]);
      }
    }
  }
  int last_handover_keyframes() {
    const auto applied = events("edge", "handover_applied");
    return applied.empty() ? 0 : applied.back()["keyframes"].get<int>();
  }

  int frames_ = kFrames;  ///< that are played
  std::map<std::string, int> far_ports_;
  std::vector<std::unique_ptr<Forwarder>> way_;
};

TEST_F(DynNetSlamProgram, GoesToTheMobileSideAndBackWithTheLatency) {
  Process edge = edge_node(), mobile = node("mobile");
  await_start();
  for (const char* changes : {"OS MES", "OS MES OS", "OS MES OS MES"}) {
    set_rtt(states().ends_with("MES") ? 4ms : 1200ms);
    await_states(changes);
    std::this_thread::sleep_for(300ms);
  }
  set_rtt(4ms);
  expect_good_end(mobile, edge);
  EXPECT_EQ(states().rfind("OS MES OS MES", 0), 0u) << states();
  EXPECT_FALSE(events("edge", "handover_applied").empty());
  EXPECT_FALSE(events("mobile", "keyframe_mapped").empty());
}

TEST_F(DynNetSlamProgram, AFrozenEdgeIsLeftAndJoinsAgain) {
  frames_ = play_for(10);
  Process edge = edge_node(), mobile = node("mobile");
  await_start();
  edge.signal(SIGSTOP);
  await_states("OS MES");
  std::this_thread::sleep_for(1s);
  edge.signal(SIGCONT);
  expect_good_end(mobile, edge);
  EXPECT_EQ(states(), "OS MES OS");
  EXPECT_GT(last_handover_keyframes(), 0);
}

TEST_F(DynNetSlamProgram, AWayThatIsCutIsLeftAndTakenAgain) {
  frames_ = play_for(10);
  Process edge = edge_node(), mobile = node("mobile");
  await_start();
  cut(true);
  await_states("OS MES");
  std::this_thread::sleep_for(1s);
  cut(false);
  expect_good_end(mobile, edge);
  EXPECT_EQ(states(), "OS MES OS");
  EXPECT_GT(last_handover_keyframes(), 0);
}

TEST_F(DynNetSlamProgram, ARestartedEdgeGetsTheWholeMap) {
  frames_ = play_for(10);
  Process mobile = node("mobile");
  {
    Process edge = edge_node();
    await_start();
  }  // SIGKILL
  await_states("OS MES");
  Process edge = edge_node();
  expect_good_end(mobile, edge);
  EXPECT_EQ(states(), "OS MES OS");
  const auto sent = events("mobile", "handover_sent");
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(sent.back()["whole"], true);
  EXPECT_EQ(events("edge", "node_restarted").size(), 1u);
  EXPECT_GT(end("edge")["keyframes"].get<int>(), 0);
}

TEST_F(DynNetSlamProgram, AnEdgeRestartedAtOnceGetsTheMapWithoutAChangeOfState) {
  frames_ = play_for(8);
  config["params"]["rtt_missing_s"] = 6.0;
  Process mobile = node("mobile");
  {
    Process edge = edge_node();
    await_start();
  }  // SIGKILL
  Process edge = edge_node();
  expect_good_end(mobile, edge);
  EXPECT_EQ(states(), "OS");
  const auto applied = events("edge", "handover_applied");
  ASSERT_EQ(applied.size(), 1u);
  EXPECT_GT(applied[0]["keyframes"].get<int>(), 0);
}

TEST_F(DynNetSlamProgram, AnEdgeThatNeverComesBackChangesNothingForTracking) {
  frames_ = play_for(6);
  Process mobile = node("mobile");
  {
    Process edge = edge_node();
    await_start();
  }  // SIGKILL
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(end("mobile")["exit_reason"], "completed");
  EXPECT_EQ(end("mobile")["frames_total"], frames_);
  EXPECT_TRUE(events("mobile", "track_lost").empty());
  EXPECT_EQ(states(), "OS MES");
}

}  // namespace
}  // namespace slambed
