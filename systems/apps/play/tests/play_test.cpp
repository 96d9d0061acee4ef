// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include "apps/play/command.hpp"
#include "apps/play/conversation.hpp"
#include "apps/play/frame_record.hpp"
#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"

namespace slambed {
namespace {

using testing::read_text;

class RecordTest : public ::testing::Test {
 protected:
  RecordTest() {
    log_.set_clock([this] { return now_; });
    log_.start({}, [] {});
  }

  void take(std::uint64_t index) {
    const PlayedFrame played{index, RunTime(static_cast<std::int64_t>(index) * 100'000'000)};
    record_.dequeued({played, played.due, played.due + Duration(1'000'000)},
                     1'000'000'000 + played.due.count());
  }
  void pose(std::uint64_t index, std::uint32_t state = SLAMBED_OK, double x = 0) {
    now_ = RunTime(static_cast<std::int64_t>(index) * 100'000'000 + 5'000'000);
    record_.tracked(packet(index, state, x), now_);
  }
  static slambed_pose packet(std::uint64_t index, std::uint32_t state, double x) {
    slambed_pose pose{};
    pose.index = index;
    pose.state = state;
    pose.t_wc[0] = x;
    pose.q_wc[3] = 1;
    pose.features = pose.inliers = -1;
    return pose;
  }
  std::string events() {
    log_.flush();
    return read_text(folder_ / "events.jsonl");
  }
  static int count(const std::string& text, const std::string& part) {
    int found = 0;
    for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
    return found;
  }

  testing::TemporaryFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
  RunTime now_{};
  EventLog log_{folder_ / "events.jsonl", NodeRole::kMobile};
  FrameRecord record_{log_};
};

TEST_F(RecordTest, PosesBecomeTheEventsThatEverySystemLeaves) {
  for (const std::uint64_t index : {0, 1, 2, 3}) take(index);
  pose(0, SLAMBED_NOT_INITIALIZED);
  pose(1);
  pose(2, SLAMBED_LOST);
  pose(3);
  const std::string text = events();
  EXPECT_EQ(count(text, "\"type\":\"frame_tracked\""), 4);
  EXPECT_EQ(count(text, "\"type\":\"initialized\""), 1);
  EXPECT_EQ(count(text, "\"type\":\"track_lost\""), 1);
  EXPECT_EQ(count(text, "\"type\":\"relocalized\""), 1);
  EXPECT_EQ(count(text, "\"track_ms\":4.000,"), 4);
  EXPECT_EQ(count(text, "\"wait_ms\":1"), 4);
}

TEST_F(RecordTest, AFrameThatWasPassedOverHasNoPose) {
  for (const std::uint64_t index : {0, 1, 2, 3}) take(index);
  pose(1);
  pose(3);
  record_.over(now_);
  const std::string text = events();
  EXPECT_EQ(count(text, "\"state\":\"not_initialized\""), 1);
  EXPECT_EQ(count(text, "\"state\":\"lost\""), 1);
  EXPECT_EQ(count(text, "\"state\":\"ok\""), 2);
}

TEST_F(RecordTest, FinalPosesMakeTheTrajectoryAndLeaveTheLiveOne) {
  take(0);
  pose(0, SLAMBED_OK, 1.0);
  record_.write_trajectories(folder_);
  EXPECT_EQ(read_text(folder_ / "trajectory.txt"), read_text(folder_ / "trajectory_live.txt"));
  record_.placed(packet(0, SLAMBED_OK, 2.0));
  record_.write_trajectories(folder_);
  EXPECT_NE(read_text(folder_ / "trajectory_live.txt").find("\n1.000000000 1.000000000 "),
            std::string::npos);
  EXPECT_NE(read_text(folder_ / "trajectory.txt").find("\n1.000000000 2.000000000 "),
            std::string::npos);
}

TEST_F(RecordTest, WhatIsNoPoseIsRefused) {
  take(0);
  EXPECT_THROW(pose(1), Error);     // never offered
  EXPECT_THROW(pose(0, 3), Error);  // no state
  EXPECT_THROW(pose(0, SLAMBED_OK, NAN), Error);
  EXPECT_THROW(pose(0, SLAMBED_OK, -1e308), Error);  // would overflow when inverted
  auto long_quaternion = packet(0, SLAMBED_OK, 0);
  long_quaternion.q_wc[3] = 2;
  EXPECT_THROW(record_.tracked(long_quaternion, now_), Error);
  EXPECT_THROW(record_.placed(packet(0, SLAMBED_OK, 0)), Error);  // never tracked
  pose(0);
  EXPECT_THROW(pose(0), Error);  // twice
}

TEST(SystemEvent, IsAnObjectWithATypeAndKeepsItsValues) {
  EXPECT_EQ(system_event(
                R"({"b": [1, "\u00e9"], "type": "map", "n": 3, "x": 0.5, "on": true, "t_ns": 7})")
                .fields(),
            R"("type":"map","b":"[1,\"é\"]","n":3,"on":true,"x":0.5)");
  for (const char* bad :
       {"", "[]", "{}", R"({"type": 1})", R"({"type": "a")", "{\"type\": \"\xff\"}",
        R"({"type": "a", "x": 1e999})", R"({"type": ""})", R"({"type": "frame_tracked"})"}) {
    EXPECT_THROW(system_event(bad), Error) << bad;
  }
}

TEST(Conversation, WhatIsNoPacketIsRefused) {
  Conversation conversation;
  const std::uint32_t next = SLAMBED_NEXT, unknown = 77, pose = SLAMBED_POSE;
  ASSERT_EQ(write(conversation.client_fd(), &next, sizeof next), 4);
  EXPECT_EQ(conversation.next()->type, SLAMBED_NEXT);
  ASSERT_EQ(write(conversation.client_fd(), &unknown, sizeof unknown), 4);
  EXPECT_THROW(conversation.next(), Error);
  ASSERT_EQ(write(conversation.client_fd(), &pose, sizeof pose), 4);  // too short
  EXPECT_THROW(conversation.next(), Error);
  conversation.forget_client();
  EXPECT_FALSE(conversation.next());
}

CommandOptions shell(const std::string& script) {
  return {.arguments = {"/bin/sh", "-c", script},
          .directory = "/",
          .environment = {{"TOLD", "7"}},
          .inherited = {}};
}

TEST(Command, TellsHowItsProgramEnded) {
  EXPECT_EQ(Command(shell("exit $TOLD")).wait(std::chrono::seconds(60)), 7);
  EXPECT_EQ(Command(shell("kill -SEGV $$")).wait(std::chrono::seconds(60)), 128 + 11);
  Command sleeper(shell("sleep 600"));
  EXPECT_FALSE(sleeper.wait(Duration::zero()));
  EXPECT_EQ(sleeper.end(), 128 + 15);
}

// Returns whether all processes have closed the pipe's write end.
bool ends(int fd) {
  pollfd closed{.fd = fd, .events = POLLIN, .revents = 0};
  char byte;
  return poll(&closed, 1, 60'000) == 1 && read(fd, &byte, 1) == 0;
}

TEST(Command, WhatItsProgramStartedEndsWithIt) {
  for (const std::string script : {"sleep 600 & exit 3", "sleep 600 & sleep 600; exit 3"}) {
    int held[2];
    ASSERT_EQ(pipe2(held, O_CLOEXEC), 0);
    const FileDescriptor reads(held[0]);
    FileDescriptor writes(held[1]);
    CommandOptions options = shell(script);
    options.inherited = {writes.get()};
    Command command(options);
    writes.reset();
    if (script.find("; exit") == std::string::npos) {
      EXPECT_EQ(command.wait(std::chrono::seconds(60)), 3);
    } else {
      EXPECT_EQ(command.end(), 128 + 15);
    }
    EXPECT_TRUE(ends(reads.get()));
  }
}

TEST(Command, AProgramThatIsNotThereIsToldAtOnce) {
  EXPECT_THROW(
      Command(
          {.arguments = {"/no/such/program"}, .directory = {}, .environment = {}, .inherited = {}}),
      Error);
}

}  // namespace
}  // namespace slambed
