// SPDX-License-Identifier: Apache-2.0
// Edge-SLAM's way of sending: one message at a time, its length first, both acknowledged.
#include "offload/channels/stop_and_wait.hpp"

#include <gtest/gtest.h>

#include "runtime/tests/tcp_nodes.hpp"
#include "runtime/virtual/virtual_network.hpp"
#include "wire/messages.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;
using testing::Node;

constexpr auto kKeyFrame = wire::type_of(wire::kKeyFrame);

/// Two nodes 10 ms apart, in virtual time.
struct Pair {
  explicit Pair(const ChannelOptions& options)
      : link(simulator, path(), path(), 1),
        below(link.mobile_side(recorder).open({.name = "k"})),
        near(mobile, recorder, below, options),
        far(edge, recorder, link.edge_side(recorder).open({.name = "k"}), options) {
    near.start();
    far.start();
  }
  static link::DirectionOptions path() {
    link::DirectionOptions options;
    options.delays_ns = {10'000'000};
    return options;
  }
  /// Runs both nodes until this time.
  void run_until(RunTime end) {
    for (VirtualRuntime* runtime : {&mobile, &edge}) {
      runtime->spawn("end", [=](Worker& worker) {
        worker.sleep_until(end);
        runtime->stop();
      });
    }
    simulator.run();
  }

  Recorder recorder;
  Simulator simulator;
  VirtualLink link;
  VirtualRuntime mobile{simulator, {}, 1, recorder}, edge{simulator, {}, 2, recorder};
  Channel& below;
  StopAndWaitChannel near, far;
};

TEST(StopAndWait, EachMessageTakesTwoRoundTrips) {
  Pair pair({.name = "k"});
  pair.mobile.spawn("sender", [&](Worker&) {
    for (std::uint8_t i = 0; i < 3; ++i) pair.near.send(kKeyFrame, Bytes(100, i));
  });
  std::vector<Message> received;
  pair.edge.spawn("receiver", [&](Worker& worker) {
    while (auto message = pair.far.receive(worker, kNever)) received.push_back(*message);
  });
  pair.run_until(1s);
  ASSERT_EQ(received.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(received[i].sequence, i + 1);
    EXPECT_EQ(received[i].type, kKeyFrame);
    EXPECT_EQ(received[i].payload, Bytes(100, static_cast<std::uint8_t>(i)));
    EXPECT_EQ(received[i].queued, 0ns);  // the time of send(), however long it waited
    // Length out, OK back, message out: 30 ms; OK back, then the next.
    EXPECT_EQ(received[i].received, 30ms + i * 40ms);
  }
}

TEST(StopAndWait, AnAnnouncedMessageIsNotAcknowledgedYet) {
  Pair pair({.name = "k"});
  std::vector<std::uint64_t> left;
  pair.mobile.spawn("sender", [&](Worker& worker) {
    pair.near.send(kKeyFrame, Bytes(5000, 1));
    for (const RunTime when : {5ms, 15ms, 22ms, 45ms, 100ms}) {
      worker.sleep_until(when);
      left.push_back(pair.near.path().unacknowledged_bytes);
    }
  });
  pair.run_until(1s);
  // At 5 and 15 ms only the length has been handed to TCP, at 22 ms the message is in transit.
  ASSERT_EQ(left.size(), 5u);
  for (int i = 0; i < 3; ++i) EXPECT_GT(left[i], 5000u) << i;
  EXPECT_EQ(left[3], 0u);
  EXPECT_EQ(left[4], 0u);
}

TEST(StopAndWait, BothDirectionsAtOnce) {
  Pair pair({.name = "k"});
  int up = 0, down = 0;
  pair.mobile.spawn("mobile", [&](Worker& worker) {
    for (int i = 0; i < 5; ++i) pair.near.send(kKeyFrame, {1});
    while (pair.near.receive(worker, kNever)) ++down;
  });
  pair.edge.spawn("edge", [&](Worker& worker) {
    for (int i = 0; i < 5; ++i) pair.far.send(kKeyFrame, {2});
    while (pair.far.receive(worker, kNever)) ++up;
  });
  pair.run_until(190ms);  // 4 * 40 + 30
  EXPECT_EQ(up, 4);
  EXPECT_EQ(down, 4);
}

TEST(StopAndWait, TheOldestWaitingMessageIsDropped) {
  Pair pair({.name = "k", .send_queue = 2, .receive_queue = 1});
  pair.mobile.spawn("sender", [&](Worker& worker) {
    pair.near.send(kKeyFrame, {1});
    worker.sleep_until(5ms);  // the first is in transfer
    for (std::uint8_t i = 2; i <= 5; ++i) pair.near.send(kKeyFrame, {i});
  });
  pair.run_until(1s);
  // 1, 4 and 5 are sent; the receiver takes none, so its queue keeps only the last.
  const auto message = pair.far.try_receive();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->payload, Bytes{5});
  EXPECT_FALSE(pair.far.try_receive());
  std::vector<std::pair<std::uint64_t, bool>> dropped;
  for (const MessageRecord& record : pair.recorder.messages()) {
    if (record.dropped) dropped.emplace_back(record.sequence, record.incoming);
  }
  EXPECT_EQ(dropped, (std::vector<std::pair<std::uint64_t, bool>>{
                         {2, false}, {3, false}, {1, true}, {4, true}}));
}

TEST(StopAndWait, NoTransferStartsWhileTheChannelIsHeld) {
  Pair pair({.name = "k"});
  pair.mobile.spawn("sender", [&](Worker& worker) {
    for (std::uint8_t i = 0; i < 3; ++i) pair.near.send(kKeyFrame, {i});
    worker.sleep_until(15ms);  // the first message's length is in transit
    pair.near.hold(true);
    worker.sleep_until(500ms);
    pair.near.hold(false);
  });
  std::vector<RunTime> received;
  pair.edge.spawn("receiver", [&](Worker& worker) {
    while (auto message = pair.far.receive(worker, kNever)) received.push_back(message->received);
  });
  pair.run_until(1s);
  EXPECT_EQ(received, (std::vector<RunTime>{30ms, 530ms, 570ms}));
}

TEST(StopAndWait, WhatCannotBeReadIsRefusedAndTheNextGoesThrough) {
  Pair pair({.name = "k"});
  constexpr auto kAnnounce = wire::type_of(wire::AnnounceMessage::kType);
  constexpr auto kAck = wire::type_of(wire::AckMessage::kType);
  pair.mobile.spawn("sender", [&](Worker&) {
    pair.below.send(kAnnounce, {1});
    pair.below.send(kAck, {});
    pair.near.send(kKeyFrame, {7});
  });
  pair.run_until(1s);
  EXPECT_EQ(pair.recorder.refused(), (std::vector<std::uint8_t>{kAnnounce, kAck}));
  const auto message = pair.far.try_receive();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->payload, Bytes{7});
}

TEST(StopAndWait, BeginsAgainWithARestartedPeer) {
  auto deaf = std::make_unique<Node>(true, 0);  // receives the length and never answers
  const std::uint16_t port = deaf->port();
  Node mobile(false, port);
  StopAndWaitChannel near(mobile.runtime, mobile.recorder, *mobile.channel, {.name = "k"});
  near.start();
  near.send(kKeyFrame, Bytes(1000, 7));
  ASSERT_TRUE(testing::await_message(*deaf));
  deaf.reset();
  Node edge(true, port);
  StopAndWaitChannel far(edge.runtime, edge.recorder, *edge.channel, {.name = "k"});
  far.start();
  std::optional<Message> message;
  ASSERT_TRUE(testing::eventually([&] { return (message = far.try_receive()).has_value(); }));
  EXPECT_EQ(message->payload, Bytes(1000, 7));
  far.send(kKeyFrame, {3});
  ASSERT_TRUE(testing::eventually([&] { return near.try_receive().has_value(); }));
  for (Node* node : {&mobile, &edge}) {
    node->runtime.stop();
    node->runtime.join();
  }
}

}  // namespace
}  // namespace slambed
