// SPDX-License-Identifier: Apache-2.0
// slambed-node as a user sees it: processes, files, ports, signals, exit codes.
#include "apps/node/tests/node_program.hpp"

namespace slambed {
namespace {

using testing::Process;
using testing::read_text;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr int kFrames = 75;

class NodeProgram : public testing::NodeProgramTest {
 protected:
  NodeProgram() : NodeProgramTest(kFrames) {}
};

TEST_F(NodeProgram, MobileAndEdgeRunOverLoopbackToTheEnd) {
  drop_no_frame();
  const int frames = play_for(3);
  Process edge = node("edge"), mobile = node("mobile", {"--verify"});
  ASSERT_TRUE(await("edge/ready.json") && await("mobile/ready.json"))
      << log("edge") << log("mobile");
  start();
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(edge.wait(), 0) << log("edge");
  const auto mobile_end = end("mobile"), edge_end = end("edge");
  EXPECT_EQ(mobile_end["exit_reason"], "completed");
  EXPECT_EQ(mobile_end["stopped"], false);
  EXPECT_EQ(mobile_end["frames_total"], frames);
  EXPECT_EQ(edge_end["exit_reason"], "bye");
  EXPECT_EQ(mobile_end["keyframes"], edge_end["keyframes"]);
  EXPECT_EQ(events("mobile", "frame_tracked").size(), static_cast<std::size_t>(frames));
  EXPECT_EQ(events("mobile", "initialized").size(), 1u);
  EXPECT_FALSE(events("edge", "keyframe_mapped").empty());
  EXPECT_FALSE(events("mobile", "update_applied").empty());
  EXPECT_FALSE(events("mobile", "rtt_sample").empty());
  EXPECT_EQ(events("mobile", "link").size(), 4u);
  EXPECT_TRUE(events("mobile", "warning").empty());
  const std::string trajectory = read_text(folder.path() / "mobile" / "trajectory.txt");
  EXPECT_GT(std::count(trajectory.begin(), trajectory.end(), '\n'), 10);
}

TEST_F(NodeProgram, OrbSlam2RunsAloneAndSequentiallyTheSameEachTime) {
  use_orbslam2();
  config["playback"]["mode"] = "every_frame";
  config["params"]["sequential"] = true;
  std::vector<std::string> trajectories;
  for (int run = 0; run < 2; ++run) {
    start();
    Process mobile = node("mobile");
    ASSERT_EQ(mobile.wait(), 0) << log("mobile");
    EXPECT_EQ(events("mobile", "frame_tracked").size(), static_cast<std::size_t>(kFrames));
    trajectories.push_back(read_text(folder.path() / "mobile" / "trajectory.txt"));
  }
  EXPECT_EQ(trajectories[0], trajectories[1]);
  EXPECT_GT(std::count(trajectories[0].begin(), trajectories[0].end(), '\n'), kFrames / 2);
}

TEST_F(NodeProgram, ARunGoesOnInTheMapOfAnEarlierOne) {
  use_orbslam2();
  config["playback"]["mode"] = "every_frame";
  config["playback"]["end_s"] = 2.0;
  config["params"]["sequential"] = true;
  config["params"]["save_map"] = true;
  start();
  ASSERT_EQ(node("mobile").wait(), 0) << log("mobile");
  const fs::path prior = folder.path() / "prior.slm";
  fs::rename(folder.path() / "mobile" / "map.slm", prior);
  const int keyframes_before = end("mobile")["keyframes"];

  config["params"]["prior_map"] = prior;
  config["playback"]["start_s"] = 1.0;
  config["playback"]["end_s"] = nullptr;
  start();
  ASSERT_EQ(node("mobile").wait(), 0) << log("mobile");
  EXPECT_TRUE(events("mobile", "initialized").empty());
  ASSERT_EQ(events("mobile", "relocalized").size(), 1u);
  EXPECT_LT(events("mobile", "relocalized")[0]["seq_s"], 0.2);
  EXPECT_FALSE(events("mobile", "keyframe_created").empty());
  EXPECT_GT(end("mobile")["keyframes"], keyframes_before);
  EXPECT_TRUE(fs::exists(folder.path() / "mobile" / "map.slm"));
}

TEST_F(NodeProgram, AMapThatCannotBeUsedIsOneLineAndExitCode2) {
  use_orbslam2();
  config["params"]["prior_map"] = folder.path() / "nowhere.slm";
  EXPECT_EQ(node("mobile").wait(), 2);
  expect_error("mobile", "nowhere.slm: cannot be opened");
  config["params"]["prior_map"] = folder.write("torn.slm", "SLMP and nothing more of it");
  EXPECT_EQ(node("mobile").wait(), 2);
  expect_error("mobile", "torn.slm: has version");
}

TEST_F(NodeProgram, SigtermEndsEarlyAndWritesEverything) {
  use_orbslam2();
  Process mobile = node("mobile");
  ASSERT_TRUE(await("mobile/ready.json")) << log("mobile");
  start();
  std::this_thread::sleep_for(600ms);
  mobile.signal(SIGTERM);
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(end("mobile")["stopped"], true);
  EXPECT_LT(end("mobile")["frames_total"].get<int>(), kFrames);
  EXPECT_TRUE(fs::exists(folder.path() / "mobile" / "trajectory.txt"));
}

TEST_F(NodeProgram, SigtermBeforeTheStartEndsTheWait) {
  Process edge = node("edge");
  ASSERT_TRUE(await("edge/ready.json")) << log("edge");
  edge.signal(SIGTERM);
  EXPECT_EQ(edge.wait(), 0) << log("edge");
  EXPECT_EQ(end("edge")["stopped"], true);
}

TEST_F(NodeProgram, TheMobileGoesOnWhenTheEdgeDies) {
  const int frames = play_for(2.4);
  Process mobile = node("mobile");
  {
    Process edge = node("edge");
    ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json")) << log("mobile");
    start();
    std::this_thread::sleep_for(1s);
  }  // SIGKILL
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(end("mobile")["exit_reason"], "completed");
  EXPECT_EQ(end("mobile")["frames_total"], frames);
  EXPECT_FALSE(events("mobile", "warning").empty());
}

TEST_F(NodeProgram, ARestartedEdgeJoinsTheRunningMobile) {
  drop_no_frame();
  Process mobile = node("mobile");
  {
    Process edge = node("edge");
    ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json")) << log("mobile");
    start();
    ASSERT_TRUE(await_event("edge", "keyframe_received"));
  }  // SIGKILL
  Process edge = node("edge");
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(edge.wait(), 0) << log("edge");
  EXPECT_EQ(end("mobile")["exit_reason"], "completed");
  EXPECT_EQ(end("edge")["exit_reason"], "bye");
  EXPECT_EQ(end("mobile")["keyframes"], end("edge")["keyframes"]);
  ASSERT_EQ(events("mobile", "edge_restarted").size(), 1u);
  const auto restart = events("mobile", "edge_restarted").front();
  EXPECT_EQ(restart["session"], 2);
  EXPECT_EQ(events("edge", "node_restarted").size(), 1u);
  // The first edge's log is kept, and the second edge maps what the mobile sends.
  const auto received = events("edge", "keyframe_received");
  EXPECT_TRUE(std::any_of(received.begin(), received.end(), [&](const auto& event) {
    return event["keyframe"] == restart["keyframe"];
  }));
  EXPECT_TRUE(std::any_of(received.begin(), received.end(), [&](const auto& event) {
    return event["keyframe"] < restart["keyframe"];
  }));
  EXPECT_TRUE(events("mobile", "track_lost").empty());
}

TEST_F(NodeProgram, AFrozenEdgeIsNoticedAndGoesOn) {
  const int frames = play_for(4);
  Process edge = node("edge"), mobile = node("mobile");
  ASSERT_TRUE(await("mobile/ready.json") && await("edge/ready.json")) << log("mobile");
  start();
  ASSERT_TRUE(await_event("edge", "keyframe_received"));
  edge.signal(SIGSTOP);
  std::this_thread::sleep_for(1500ms);
  edge.signal(SIGCONT);
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(edge.wait(), 0) << log("edge");
  EXPECT_EQ(end("edge")["exit_reason"], "bye");
  EXPECT_EQ(end("mobile")["frames_total"], frames);
  std::vector<std::string> changes;
  for (const auto& link : events("mobile", "link")) {
    if (link["event"] != "connected") changes.push_back(link["event"]);
  }
  EXPECT_EQ(changes, (std::vector<std::string>{"silent", "alive"}));
  EXPECT_TRUE(events("mobile", "edge_restarted").empty());
}

TEST_F(NodeProgram, GarbageOnAPortIsRecordedAndChangesNothing) {
  play_for(1);
  Process edge = node("edge");
  ASSERT_TRUE(await("edge/ready.json")) << log("edge");
  const int fd = testing::connect_to(config["network"]["ports"]["keyframe"]);
  ASSERT_GE(fd, 0);
  const std::string garbage = "GET / HTTP/1.1\r\nHost: localhost\r\nUser-Agent: garbage\r\n\r\n";
  ASSERT_GT(::send(fd, garbage.data(), garbage.size(), MSG_NOSIGNAL), 0);
  Process mobile = node("mobile");
  ASSERT_TRUE(await("mobile/ready.json")) << log("mobile");
  start();
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(edge.wait(), 0) << log("edge");
  ::close(fd);
  int rejected = 0;
  for (const auto& link : events("edge", "link")) rejected += link["event"] == "rejected";
  EXPECT_EQ(rejected, 1);
}

TEST_F(NodeProgram, BadInputIsOneLineAndExitCode2) {
  config["params"]["n_orbs"] = 3;
  Process unknown_parameter = node("mobile");
  EXPECT_EQ(unknown_parameter.wait(), 2);
  expect_error("mobile", "params.n_orbs is unknown");
  config["params"].erase("n_orbs");
  config["system"] = "nosuch";
  Process unknown_system = node("mobile");
  EXPECT_EQ(unknown_system.wait(), 2);
  expect_error("mobile", "'nosuch'");
  config["system"] = "edgeslam";
  config["sequence"] = "/nonexistent-sequence";
  Process no_sequence = node("mobile");
  EXPECT_EQ(no_sequence.wait(), 2);
  expect_error("mobile", "/nonexistent-sequence");
  use_orbslam2();
  Process edge = node("edge");
  EXPECT_EQ(edge.wait(), 2);
  expect_error("edge", "orbslam2");
  Process no_role({SLAMBED_NODE, "--role", "server"}, folder.path() / "mobile.log");
  EXPECT_EQ(no_role.wait(), 2);
  expect_error("mobile", "--role");
}

TEST_F(NodeProgram, ATakenPortIsExitCode3AndAMissingPeerExitCode4) {
  Process first = node("edge");
  ASSERT_TRUE(await("edge/ready.json")) << log("edge");
  testing::TemporaryFolder other;
  auto config_of_second = config;
  config_of_second["output"] = other.path();
  const auto path = other.write("run.json", config_of_second.dump());
  Process second({SLAMBED_NODE, "--role", "edge", "--config", path}, folder.path() / "second.log");
  EXPECT_EQ(second.wait(), 3);
  expect_error("second", "port");
  first.signal(SIGTERM);
  first.wait();
  config["connect_timeout_s"] = 0.2;
  Process mobile = node("mobile");
  EXPECT_EQ(mobile.wait(), 4);
  expect_error("mobile", "no edge node at 127.0.0.1");
}

TEST_F(NodeProgram, HelpVersionAndDescription) {
  for (const char* option : {"--help", "--version", "--describe"}) {
    Process asked({SLAMBED_NODE, option}, folder.path() / "out");
    EXPECT_EQ(asked.wait(), 0) << option;
    EXPECT_FALSE(read_text(folder.path() / "out").empty());
  }
  const auto described = nlohmann::json::parse(read_text(folder.path() / "out"));
  EXPECT_EQ(described["edgeslam"]["params"]["map_update"]["choices"][1], "parallel");
}

}  // namespace
}  // namespace slambed
