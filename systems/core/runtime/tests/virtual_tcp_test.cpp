// SPDX-License-Identifier: Apache-2.0
// How the modeled TCP handles packet loss and outages.
#include <gtest/gtest.h>

#include <vector>

#include "runtime/tests/virtual_nodes.hpp"
#include "runtime/virtual/tcp_cubic.hpp"
#include "runtime/virtual/tcp_receiver.hpp"

namespace slambed {
namespace {

using namespace testing;
using namespace std::chrono_literals;

TEST(VirtualNetwork, LossIsRepairedAndEverythingArrivesInOrder) {
  Nodes nodes(constant(10, 0, 0.05), constant(10, 0, 0.05));
  std::vector<RunTime> times;
  for (int i = 0; i < 50; ++i) times.push_back(i * 100ms);
  const auto received = deliver(nodes, 30'000, times);
  ASSERT_EQ(received.size(), times.size());
  EXPECT_GT(nodes.link.up().dropped(), 20u);
  // A loss delays messages by an RTO or a round trip. No message arrives earlier than without loss.
  Nodes clean(constant(10), constant(10));
  const auto without_loss = deliver(clean, 30'000, times);
  int late = 0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    EXPECT_GE(received[i], without_loss[i]) << i;
    late += received[i] >= without_loss[i] + 20ms;
  }
  EXPECT_GT(late, 10);
}

/// A link that drops everything from 100 ms to the given time.
DirectionOptions cut(std::int64_t until_ms) {
  DirectionOptions options = constant(10);
  options.gaps = {{.start_ns = 100 * kMs, .end_ns = until_ms * kMs}};
  options.gap_drops = true;
  return options;
}

TEST(VirtualNetwork, AfterATimeOutTheWindowOpensInSlowStart) {
  Nodes nodes(cut(450), constant(10));
  // The window is 80 segments, and all of the second message is lost. After timeouts at 320 and 760
  // ms, 1, 2, 4 ... segments leave per round trip, up to the limit of 56.
  const std::size_t bytes = 70 * TcpFlow::kSegmentBytes - 44;
  const auto received = deliver(nodes, bytes, {0ms, 95ms});
  EXPECT_GT(received[1], 700ms);
  EXPECT_LT(received[1], 1000ms);
}

TEST(VirtualNetwork, OneLossOfAFlightCostsARoundTripAndNotATimeOut) {
  // A queue of eight full packets drops some packets at the end of the first flight.
  DirectionOptions narrow = constant(10, 10);
  narrow.rate->queue_bytes = 12'000;
  Nodes nodes(narrow, constant(10));
  EXPECT_LT(deliver(nodes, 100'000, {0ms})[0], 200ms);
  EXPECT_GT(nodes.link.up().dropped(), 0u);
}

TEST(VirtualNetwork, ALostTailIsProbedBeforeTheTimeOut) {
  // The last message is lost. A tail-loss probe after two round trips recovers it.
  DirectionOptions up = constant(10);
  up.gaps = {{.start_ns = 112 * kMs, .end_ns = 116 * kMs}};
  up.gap_drops = true;
  Nodes nodes(up, constant(10));
  const auto received = deliver(nodes, 100, {0ms, 50ms, 103ms});
  EXPECT_GT(received[2], 103ms + 200ms);  // a single segment waits longer, as in Linux
  EXPECT_LT(received[2], 103ms + 260ms);
}

TEST(VirtualNetwork, AStallIsToldOnceAndSoIsItsEnd) {
  Nodes nodes(cut(5000), constant(10));
  deliver(nodes, 30'000, {0ms, 95ms, 500ms});
  ASSERT_EQ(nodes.observer.stalls.size(), 2u);
  EXPECT_EQ(nodes.observer.stalls[0], "stalled nothing acknowledged for 1000 ms");
  EXPECT_EQ(nodes.observer.stalls[1].substr(0, 7), "flowing");
}

TEST(TcpReceiver, TellsThePiecesBeyondAHoleNewestFirst) {
  TcpReceiver receiver;
  receiver.take({0, 10}, 1ms);
  receiver.take({20, 30}, 2ms);
  const TcpAck ack = receiver.take({40, 50}, 3ms);
  EXPECT_EQ(ack.upto, 10u);
  EXPECT_EQ(ack.echo, 1ms);
  ASSERT_EQ(ack.blocks, 2);
  EXPECT_EQ(ack.sacked[0].from, 40u);
  EXPECT_EQ(ack.sacked[1].to, 30u);
  EXPECT_TRUE(receiver.take({20, 30}, 4ms).duplicate);
  const TcpAck filled = receiver.take({10, 20}, 5ms);
  EXPECT_EQ(filled.upto, 30u);
  EXPECT_EQ(filled.blocks, 1);
  EXPECT_EQ(filled.echo, 5ms);
}

TEST(TcpCubic, SlowStartEndsAtItsLimit) {
  TcpCubic cubic;
  cubic.slow_start_limit = 12;
  cubic.grow(10, 1s, 20ms);
  EXPECT_GE(cubic.window, 12);
  EXPECT_LT(cubic.window, 14);
}

}  // namespace
}  // namespace slambed
