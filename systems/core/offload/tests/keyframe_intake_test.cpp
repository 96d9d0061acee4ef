// SPDX-License-Identifier: Apache-2.0
// Keyframes that arrive at an edge are parsed and checked, then admitted or declined.
#include "offload/uplink/keyframe_intake.hpp"

#include <gtest/gtest.h>

#include "offload/tests/two_nodes.hpp"
#include "offload/uplink/admission.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

class Intake : public ::testing::Test, protected KeyFrameRecipient {
 protected:
  Intake() : Intake(ChannelOptions{.name = "keyframe"}) {}
  explicit Intake(const ChannelOptions& options) : ends(nodes.open(options)) {}

  void received(const wire::KeyFrameMessage&) override { ++keyframes_received; }
  std::optional<std::string_view> keyframe_decline_reason(
      const wire::KeyFrameMessage& message) const override {
    if (message.keyframe == unwelcome) return reason;
    return std::nullopt;
  }
  void admit(Worker&, AdmittedKeyFrame keyframe) override {
    admitted.push_back(std::move(keyframe));
  }
  void send_all_at(RunTime when) {
    nodes.on_mobile([this, when](Worker& worker) {
      worker.sleep_until(when);
      for (const auto& message : turn.messages) send(ends.first, wire::kKeyFrame, encode(message));
    });
  }

  TwoNodes nodes;
  std::pair<Channel&, Channel&> ends;
  SentTurn turn{3};
  KeyFrameId unwelcome;
  std::string_view reason = "mapper busy";
  int keyframes_received = 0;
  std::vector<AdmittedKeyFrame> admitted;
};

TEST_F(Intake, EachIsReadAndGivenOnWithTheTimesOfItsWay) {
  turn.messages[1].captured = 700ms;
  KeyFrameIntake intake(nodes.edge, ends.second, {}, *this);
  intake.start();
  send_all_at(1s);
  nodes.run_until(3s);
  ASSERT_EQ(admitted.size(), 3u);
  EXPECT_EQ(keyframes_received, 3);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(admitted[i].message.keyframe, turn.id(i));
  EXPECT_EQ(admitted[1].times.captured, 700ms);
  EXPECT_EQ(admitted[1].times.queued, 1s);
  EXPECT_GE(admitted[1].times.received, 1s + TwoNodes::kOneWay);
}

TEST_F(Intake, ADeclinedOneIsRecordedAndGoesNoFurther) {
  unwelcome = turn.id(1);
  KeyFrameIntake intake(nodes.edge, ends.second, {}, *this);
  intake.ask_when_empty();  // only answers another decline reason
  intake.start();
  send_all_at(1s);
  nodes.run_until(3s);
  EXPECT_EQ(keyframes_received, 3);
  ASSERT_EQ(admitted.size(), 2u);
  const auto declined = nodes.events("keyframe_declined");
  ASSERT_EQ(declined.size(), 1u);
  EXPECT_EQ(declined[0]["keyframe"], unwelcome.value);
  EXPECT_EQ(declined[0]["reason"], std::string(reason));
  EXPECT_FALSE(ends.first.try_receive());
}

TEST_F(Intake, AnEdgeWithoutAMapAsksForAKeyframeWhereItShould) {
  unwelcome = turn.id(0);
  reason = kNoMap;
  KeyFrameIntake intake(nodes.edge, ends.second, {}, *this);
  intake.ask_when_empty();
  intake.start();
  send_all_at(1s);
  nodes.run_until(3s);
  const auto asked = ends.first.try_receive();
  ASSERT_TRUE(asked);
  EXPECT_TRUE(is(*asked, wire::kKeyFrameWanted));
}

TEST_F(Intake, WhatCannotBeReadIsRefusedAndTheNextOneTaken) {
  KeyFrameIntake intake(nodes.edge, ends.second, {}, *this);
  intake.start();
  nodes.on_mobile([this](Worker&) {
    send(ends.first, wire::kKeyFrame, Bytes(40, 7));
    send(ends.first, wire::kProbe, Bytes(64));
    send(ends.first, wire::kKeyFrame, encode(turn.messages[0]));
  });
  bool in_time = false;
  nodes.on_edge([&](Worker& worker) {
    intake.wait_for(worker, 3, 2s);
    in_time = worker.now() < 2s;
  });
  nodes.run_until(3s);
  EXPECT_EQ(keyframes_received, 1);
  EXPECT_EQ(admitted.size(), 1u);
  EXPECT_EQ(nodes.events("warning").size(), 1u);
  EXPECT_TRUE(in_time) << "what is refused or ignored has come all the same";
}

TEST_F(Intake, WhoWaitsForOneThatNeverComesWaitsUntilTheDeadline) {
  KeyFrameIntake intake(nodes.edge, ends.second, {}, *this);
  intake.start();
  RunTime ended{};
  nodes.on_edge([&](Worker& worker) {
    intake.wait_for(worker, 1, 2s);
    ended = worker.now();
  });
  nodes.run_until(3s);
  EXPECT_EQ(ended, 2s);
}

struct QueueOfTwo : Intake {
  QueueOfTwo() : Intake({.name = "keyframe", .receive_queue = 2}) {}
};

TEST_F(QueueOfTwo, UntilTheMapperLooksTheNewestWaitUnread) {
  bool idle = false;
  KeyFrameIntake intake(nodes.edge, ends.second, {}, *this);
  intake.wait_for_mapper([&] { return idle; });
  intake.start();
  send_all_at(0s);
  std::vector<std::size_t> seen;
  nodes.on_edge([&](Worker& worker) {
    for (const RunTime when : {1s, 2s, 3s}) {
      worker.sleep_until(when);
      seen.push_back(admitted.size());
      if (when == 2s) idle = true;
      intake.look();
    }
  });
  nodes.run_until(4s);
  EXPECT_EQ(seen, (std::vector<std::size_t>{0, 1, 2}));
  ASSERT_EQ(admitted.size(), 2u);
  EXPECT_EQ(admitted[0].message.keyframe, turn.id(1)) << "the oldest was dropped";
}

}  // namespace
}  // namespace slambed::testing
