// SPDX-License-Identifier: Apache-2.0
// Multithread-RL's nodes as processes: the edge fails while suspended by a lost mobile, and peers
// use another wire version.
#include <algorithm>
#include <array>
#include <string>

#include "apps/node/tests/far_edge.hpp"
#include "runtime/frame_header.hpp"
#include "wire/hello.hpp"
#include "wire/message_type.hpp"
#include "wire/tests/examples.hpp"

namespace slambed {
namespace {

using testing::Process;
using namespace std::chrono_literals;

constexpr int kFrames = 128;  // 8.5 s
/// The lens stays covered long enough for the log to show it and for a fault to end.
constexpr double kDarkFrom_s = 2, kDarkTo_s = 5;
constexpr auto kFault = 1500ms;  ///< longer than the silence after which a peer counts as away
const std::vector<std::string> kChannels = {"control", "keyframe", "map", "frame"};

/// The camera moves back and forth, and after the darkness sees what it saw before.
synth::GeneratorOptions covered_for_a_while() {
  synth::GeneratorOptions options;
  options.trajectory = "xyz";
  options.sensor_model.blackout_start_s = kDarkFrom_s;
  options.sensor_model.blackout_end_s = kDarkTo_s;
  return options;
}

class MultithreadRlProgram : public testing::FarEdgeTest {
 protected:
  MultithreadRlProgram() : FarEdgeTest(kFrames, kChannels, covered_for_a_while()) {
    use("multithread_rl");
    config["variant"] = "multithread_rl";
    config["params"].update({{"map_update", "staged"},
                             {"relocalization", "edge"},
                             {"keep_recovery_keyframe", true},
                             {"reloc_fail_bytes", 75'000},
                             {"keyframe_backup", "update"},
                             {"prior_map", ""}});
  }

  /// Waits until both nodes are connected, the lens is covered and the mobile has sent SUSPEND.
  void await_suspension() {
    ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json"))
        << log("mobile") << log("edge");
    start();
    ASSERT_TRUE(await_event("mobile", "update_applied"));
    for (int i = 0; i < 600 && suspensions().empty(); ++i) std::this_thread::sleep_for(50ms);
    ASSERT_FALSE(suspensions().empty());
  }
  /// Returns the suspensions that begin in the dark; a slow machine may have earlier ones.
  std::vector<nlohmann::json> suspensions() {
    auto found = events("mobile", "suspended");
    std::erase_if(found, [](const auto& event) {
      return event["seq_s"] < kDarkFrom_s || event["seq_s"] > kDarkTo_s;
    });
    return found;
  }
  /// Expects that the mobile played to the end, was lost at the fault and relocalized afterwards,
  /// and applied no update in between.
  void expect_it_went_on(Process& mobile, std::int64_t fault_ns) {
    EXPECT_EQ(mobile.wait(), 0) << log("mobile");
    EXPECT_EQ(end("mobile")["exit_reason"], "completed");
    EXPECT_EQ(end("mobile")["frames_total"], frames_);
    const auto lost = suspensions();
    ASSERT_FALSE(lost.empty());
    const std::int64_t suspended_ns = lost.front()["t_ns"];
    const auto resumed = events_after(suspended_ns, "mobile", "resumed");
    ASSERT_FALSE(resumed.empty());
    resumed_ns_ = resumed.front()["t_ns"];
    EXPECT_LT(suspended_ns, fault_ns);
    EXPECT_LT(fault_ns, resumed_ns_) << "the fault came when the loss was over";
    EXPECT_GE(resumed.front()["seq_s"], kDarkTo_s);
    for (const auto& update : events_after(suspended_ns, "mobile", "update_applied"))
      EXPECT_GT(update["t_ns"], resumed_ns_) << update;
    EXPECT_EQ(events("mobile", "frame_tracked").back()["state"], "ok");
  }
  void expect_updates_again() {
    EXPECT_FALSE(events_after(resumed_ns_, "edge", "update_sent").empty());
    EXPECT_FALSE(events_after(resumed_ns_, "mobile", "update_applied").empty());
  }
  void expect_parted_in_order(Process& edge) {
    EXPECT_EQ(edge.wait(), 0) << log("edge");
    EXPECT_EQ(end("edge")["exit_reason"], "bye");
  }

  int frames_ = kFrames;  ///< number of frames played
  std::int64_t resumed_ns_ = 0;
};

TEST_F(MultithreadRlProgram, AnEdgeKilledWhileSuspendedIsNotWaitedFor) {
  frames_ = play_for(7);  // no later frames are needed
  Process mobile = node("mobile");
  std::int64_t killed = 0;
  {
    Process edge = edge_node();
    ASSERT_NO_FATAL_FAILURE(await_suspension());
    killed = now_ns();
  }  // SIGKILL
  ASSERT_NO_FATAL_FAILURE(expect_it_went_on(mobile, killed));
  // The mobile sends no requests while the edge is away.
  const auto requests = events_after(killed, "mobile", "reloc_request");
  const auto given_up = events_after(killed, "mobile", "reloc_given_up");
  EXPECT_LE(requests.size(), given_up.size() + 1);
  const auto found = events_after(killed, "mobile", "relocalized");
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front()["by"], "local");
}

TEST_F(MultithreadRlProgram, AnEdgeFrozenWhileSuspendedSendsUpdatesAfterTheRecovery) {
  Process edge = edge_node(), mobile = node("mobile");
  ASSERT_NO_FATAL_FAILURE(await_suspension());
  const auto frozen = now_ns();
  edge.signal(SIGSTOP);
  std::this_thread::sleep_for(kFault);
  edge.signal(SIGCONT);
  ASSERT_NO_FATAL_FAILURE(expect_it_went_on(mobile, frozen));
  expect_parted_in_order(edge);
  expect_updates_again();
  EXPECT_TRUE(events("mobile", "edge_restarted").empty());
}

TEST_F(MultithreadRlProgram, AWayCutWhileSuspendedBringsUpdatesAfterTheRecovery) {
  Process edge = edge_node(), mobile = node("mobile");
  ASSERT_NO_FATAL_FAILURE(await_suspension());
  const auto broken = now_ns();
  cut(true);
  std::this_thread::sleep_for(kFault);
  cut(false);
  ASSERT_NO_FATAL_FAILURE(expect_it_went_on(mobile, broken));
  expect_parted_in_order(edge);
  expect_updates_again();
  EXPECT_TRUE(events("mobile", "edge_restarted").empty());
}

TEST_F(MultithreadRlProgram, AnEdgeRestartedWhileSuspendedSendsUpdatesThoughNobodySuspendedIt) {
  Process mobile = node("mobile");
  std::int64_t killed = 0;
  {
    Process edge = edge_node();
    ASSERT_NO_FATAL_FAILURE(await_suspension());
    killed = now_ns();
  }  // SIGKILL
  Process edge = edge_node();
  ASSERT_NO_FATAL_FAILURE(expect_it_went_on(mobile, killed));
  expect_parted_in_order(edge);
  expect_updates_again();
  EXPECT_EQ(events("mobile", "edge_restarted").size(), 1u);
  EXPECT_EQ(events("edge", "node_restarted").size(), 1u);
}

/// Makes a greeting as another version of the programs would send it.
std::pair<FrameHeader, wire::Bytes> greeting(const std::string& channel, NodeRole role, int step) {
  wire::Hello hello{.wire_version = static_cast<std::uint16_t>(wire::kWireVersion + step),
                    .role = role,
                    .channel = channel,
                    .run_key = "test",
                    .system = "multithread_rl",
                    .sensor = {}};
  if (role == NodeRole::kMobile) hello.sensor = wire::example_camera();
  wire::Bytes payload = encode(hello);
  FrameHeader header{.flags = FrameHeader::kGreetingFlag, .sequence = 77};
  header.length = static_cast<std::uint32_t>(payload.size());
  header.payload_crc = checksum(payload);
  return {header, std::move(payload)};
}

void send_greeting(int fd, const std::pair<FrameHeader, wire::Bytes>& greeting) {
  const auto header = greeting.first.encode();
  ::send(fd, header.data(), header.size(), MSG_NOSIGNAL);
  ::send(fd, greeting.second.data(), greeting.second.size(), MSG_NOSIGNAL);
}

std::string of_another_version(int step) {
  return "peer has wire version " + std::to_string(wire::kWireVersion + step) + ", not " +
         std::to_string(wire::kWireVersion);
}

TEST_F(MultithreadRlProgram, AMobileOfAnotherWireVersionIsTurnedAwayInOneLineOnEachChannel) {
  config["playback"]["end_s"] = 1.0;
  Process edge = edge_node();
  ASSERT_TRUE(await("edge/ready.json")) << log("edge");
  std::vector<int> strangers;
  for (const std::string& channel : kChannels) {
    for (const int step : {-1, 1}) {
      strangers.push_back(testing::connect_to(far_port(channel)));
      send_greeting(strangers.back(), greeting(channel, NodeRole::kMobile, step));
    }
  }
  for (const int fd : strangers) {  // until the edge has closed it
    std::array<char, 4096> bytes{};
    while (::recv(fd, bytes.data(), bytes.size(), 0) > 0) {
    }
    ::close(fd);
  }
  Process mobile = node("mobile");
  ASSERT_TRUE(await("mobile/ready.json")) << log("mobile");
  start();
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  expect_parted_in_order(edge);
  std::map<std::string, std::vector<std::string>> reported;
  for (const auto& link : events("edge", "link"))
    if (link["event"] == "rejected") reported[link["channel"]].push_back(link["detail"]);
  std::vector<std::string> expected{of_another_version(-1), of_another_version(1)};
  std::ranges::sort(expected);
  for (const std::string& channel : kChannels) {
    std::ranges::sort(reported[channel]);  // the greetings of two connections may change places
    EXPECT_EQ(reported[channel], expected) << channel;
  }
}

/// A peer greets as an edge on every channel; the mobile accepts it only with its own wire version.
TEST_F(MultithreadRlProgram, AnEdgeOfAnotherWireVersionIsNoEdge) {
  config["connect_timeout_s"] = 2.0;
  for (const int step : {-1, 1, 0}) {
    std::vector<std::unique_ptr<testing::Listener>> edge;
    for (const std::string& channel : kChannels) {
      edge.push_back(std::make_unique<testing::Listener>(
          [=](int fd) { send_greeting(fd, greeting(channel, NodeRole::kEdge, step)); }));
      config["network"]["ports"][channel] = edge.back()->port();
    }
    if (step == 0) config["connect_timeout_s"] = 20.0;
    Process mobile = node("mobile");
    if (step == 0) {
      EXPECT_TRUE(await("mobile/ready.json")) << log("mobile");
      mobile.signal(SIGTERM);
      EXPECT_EQ(mobile.wait(), 0) << log("mobile");
    } else {
      EXPECT_EQ(mobile.wait(), 4);
      expect_error("mobile", "no edge node at 127.0.0.1");
      EXPECT_FALSE(std::filesystem::exists(folder.path() / "mobile" / "ready.json"));
    }
    clear();
  }
}

}  // namespace
}  // namespace slambed
