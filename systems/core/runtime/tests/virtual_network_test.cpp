// SPDX-License-Identifier: Apache-2.0
// The modeled link: delays, serialization, slow start, smoothed RTT, queues, a silent peer.
#include "runtime/virtual/virtual_network.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "runtime/tests/virtual_nodes.hpp"

namespace slambed {
namespace {

using namespace testing;
using namespace std::chrono_literals;

TEST(VirtualNetwork, ASmallMessageTakesTheOneWayDelay) {
  Nodes nodes(constant(20), constant(30));
  EXPECT_EQ(deliver(nodes, 100, {0ms, 1s}), (std::vector<Duration>{20ms, 1020ms}));
  EXPECT_EQ(nodes.link.rtt_now(), 50ms);
  EXPECT_EQ(nodes.observer.links, 2);
}

TEST(VirtualNetwork, SlowStartCostsRoundTrips) {
  Nodes nodes(constant(10), constant(10));
  // 10 segments leave at once, then 20, then 40: 70 segments arrive in the third flight.
  const std::size_t bytes = 70 * TcpFlow::kSegmentBytes - 44;
  EXPECT_EQ(deliver(nodes, bytes, {0ms}), std::vector<Duration>{10ms + 2 * 20ms});
}

TEST(VirtualNetwork, TheWindowStaysOpenWhileBusyAndClosesWhenIdle) {
  Nodes nodes(constant(10), constant(10));
  const std::size_t bytes = 70 * TcpFlow::kSegmentBytes - 44;
  const auto received = deliver(nodes, bytes, {0ms, 100ms, 5s});
  EXPECT_EQ(received[1], 110ms);      // idle for less than an RTO: one flight
  EXPECT_EQ(received[2], 5s + 50ms);  // idle: slow start again
}

TEST(VirtualNetwork, AShortIdleTimeHalvesTheWindow) {
  Nodes nodes(constant(10), constant(10));
  const std::size_t bytes = 70 * TcpFlow::kSegmentBytes - 44;
  // The first message opens the window to 80 segments. The idle time before the second is between
  // one and two RTOs: 40 segments leave at once, the other 30 a round trip later.
  EXPECT_EQ(deliver(nodes, bytes, {0ms, 400ms})[1], 400ms + 10ms + 20ms);
}

TEST(VirtualNetwork, TheRateSerializesAllChannelsTogether) {
  Nodes nodes(constant(0, 8), constant(0));
  // 8 Mbit/s are 1 byte per microsecond. A message is 1,000 bytes plus 52 bytes of packet header.
  const auto received = deliver(nodes, 1000 - 44, {0ms, 0ms});
  EXPECT_EQ(received[0], 1052us);
  EXPECT_EQ(received[1], 2104us);
}

TEST(VirtualNetwork, FallingDelayNeverReorders) {
  DirectionOptions up;
  up.delays_ns.clear();
  for (int i = 0; i < 100; ++i) up.delays_ns.push_back((100 - i) * kMs);  // 1 ms less per 10 ms
  Nodes nodes(up, constant(0));
  std::vector<RunTime> times;
  // Never more segments in flight than the initial window of ten.
  for (int i = 0; i < 95; ++i) times.push_back(i * 11ms);
  const auto received = deliver(nodes, 100, times);
  ASSERT_EQ(received.size(), times.size());
  for (std::size_t i = 0; i < times.size(); ++i)
    EXPECT_EQ(received[i], times[i] + std::max<Duration>(1ms, 100ms - times[i] / 10)) << i;
}

TEST(VirtualNetwork, APacketDoesNotOvertakeWhereTheDelayCollapses) {
  DirectionOptions up;
  up.delays_ns = {100 * kMs, 100 * kMs, 1 * kMs};  // within 10 ms
  Simulator simulator;
  CountingObserver observer;
  PathModel path(simulator, up, 7, 0);
  VirtualRuntime runtime(simulator, {}, 1, observer);
  std::vector<std::pair<int, RunTime>> arrived;
  runtime.spawn("sender", [&](Worker& w) {
    for (int i = 0; i < 20; ++i) {
      w.sleep_until(i * 2ms);
      path.transmit(100, [&, i] { arrived.emplace_back(i, simulator.now()); });
    }
    w.sleep_until(1s);
  });
  simulator.run();
  runtime.join();
  ASSERT_EQ(arrived.size(), 20u);
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(arrived[static_cast<std::size_t>(i)].first, i);
    // The sixth, sent at 10 ms, arrives at 110 ms; later ones could have arrived before it.
    EXPECT_EQ(arrived[static_cast<std::size_t>(i)].second, std::min(i * 2ms + 100ms, 110ms));
  }
}

TEST(VirtualNetwork, DelayIsLinearBetweenItsSteps) {
  DirectionOptions up;
  up.delays_ns = {10 * kMs, 20 * kMs, 20 * kMs, 40 * kMs};  // at 0, 10, 20, 30 ms
  Nodes nodes(up, constant(0));
  EXPECT_EQ(deliver(nodes, 100, {0ms, 4ms, 15ms, 25ms, 1s}),
            (std::vector<Duration>{10ms, 18ms, 35ms, 55ms, 1040ms}));
}

TEST(VirtualNetwork, SmoothedRttLagsBehindAStepWithGainOneEighth) {
  DirectionOptions up;
  up.delays_ns.assign(100, 5 * kMs);
  up.delays_ns.resize(1000, 45 * kMs);  // up by 40 ms in the 10 ms before 1 s
  Nodes nodes(up, constant(5));
  std::vector<double> rtt;
  nodes.mobile.spawn("sender", [&](Worker& w) {
    for (int i = 0; i < 30; ++i) {
      w.sleep_until(i * 100ms);
      rtt.push_back(to_ms(*nodes.near.path().smoothed_rtt));
      nodes.near.send(1, Bytes(10));
    }
  });
  nodes.edge.spawn("receiver", [&](Worker& w) {
    for (int i = 0; i < 30; ++i) nodes.far.receive(w, w.now() + 10s);
  });
  nodes.simulator.run();
  EXPECT_NEAR(rtt[10], 10, 1e-6);
  EXPECT_NEAR(rtt[11], 10 + 40.0 / 8, 1e-3);
  EXPECT_NEAR(rtt[12], 15 + 35.0 / 8, 1e-3);
  EXPECT_NEAR(rtt[29], 50, 5);
}

TEST(VirtualNetwork, AFullSendQueueDropsTheOldest) {
  Nodes nodes(constant(10, 1), constant(10), {.name = "keyframe", .send_queue = 2});
  // At 1 Mbit/s a message of 200 kB takes 1.6 s. Of ten sent at once, those that the transport
  // already holds and the two newest survive.
  std::vector<std::uint64_t> sequences;
  nodes.mobile.spawn("sender", [&](Worker&) {
    for (int i = 0; i < 10; ++i) nodes.near.send(1, Bytes(200'000));
  });
  nodes.edge.spawn("receiver", [&](Worker& w) {
    while (auto m = nodes.far.receive(w, w.now() + 20s)) sequences.push_back(m->sequence);
  });
  nodes.simulator.run();
  EXPECT_EQ(sequences, (std::vector<std::uint64_t>{1, 9, 10}));
  EXPECT_EQ(nodes.observer.dropped, 7);
}

TEST(VirtualNetwork, NoTransferStartsWhileTheChannelIsHeld) {
  Nodes nodes(constant(10, 1), constant(10), {.name = "keyframe", .send_queue = 2});
  std::vector<std::pair<std::uint64_t, RunTime>> sent;
  nodes.mobile.spawn("sender", [&](Worker& w) {
    nodes.near.send(1, Bytes(20'000));  // takes 160 ms
    nodes.near.hold(true);
    for (int i = 0; i < 3; ++i) nodes.near.send(1, Bytes(100));
    w.sleep_until(1s);
    nodes.near.hold(false);
  });
  nodes.edge.spawn("receiver", [&](Worker& w) {
    while (auto m = nodes.far.receive(w, w.now() + 5s)) sent.emplace_back(m->sequence, m->sent);
  });
  nodes.simulator.run();
  EXPECT_EQ(sent, (std::vector<std::pair<std::uint64_t, RunTime>>{{1, 0s}, {3, 1s}, {4, 1s}}));
  EXPECT_EQ(nodes.observer.dropped, 1);  // the queue keeps its limit
}

TEST(VirtualNetwork, AGapHoldsWhatWouldArriveInIt) {
  DirectionOptions up = constant(10);
  up.gaps = {{.start_ns = 100 * kMs, .end_ns = 300 * kMs}};
  Nodes nodes(up, constant(10));
  EXPECT_EQ(deliver(nodes, 100, {0ms, 95ms, 400ms}), (std::vector<Duration>{10ms, 300ms, 410ms}));
}

TEST(VirtualNetwork, ThePeerIsAwayInALongGapForTheSideThatListens) {
  DirectionOptions down = constant(10);
  down.gaps = {{.start_ns = 2000 * kMs, .end_ns = 2900 * kMs},
               {.start_ns = 5000 * kMs, .end_ns = 10000 * kMs}};
  Nodes nodes(constant(10), down, {.name = "map", .heartbeat = true});
  EXPECT_EQ(nodes.link.edge_side(nodes.observer).peer(), (PeerState{true, 1}));
  std::vector<std::pair<RunTime, bool>> changes;
  nodes.mobile.spawn("watch", [&](Worker& w) {
    Network& network = nodes.link.mobile_side(nodes.observer);
    for (auto ticket = network.peer_signal().ticket(); w.now() < 20s;) {
      if (!w.wait(network.peer_signal(), ticket, 20s)) break;
      ticket = network.peer_signal().ticket();
      changes.emplace_back(w.now(), network.peer().connected);
      EXPECT_TRUE(nodes.link.edge_side(nodes.observer).peer().connected);
    }
  });
  nodes.simulator.run();
  EXPECT_EQ(changes, (std::vector<std::pair<RunTime, bool>>{{6s, false}, {10s, true}}));
  EXPECT_EQ(nodes.observer.links, 2 + 2);  // connected at both ends; silent, alive
}

TEST(VirtualNetwork, AFrozenEdgesKernelAcknowledgesWhatItsProgramReadsLater) {
  Nodes nodes(constant(10), constant(10), {.name = "map", .heartbeat = true});
  for (const bool frozen : {true, false}) {
    nodes.simulator.at(frozen ? 1s : 4s, [&, frozen] {
      nodes.edge.freeze(frozen);
      nodes.link.freeze_edge(frozen);
    });
  }
  std::vector<bool> connected;
  std::uint64_t unacknowledged = 1;
  for (const auto t : {1900ms, 2100ms, 3900ms, 4100ms}) {
    nodes.simulator.at(t, [&] {
      connected.push_back(nodes.link.mobile_side(nodes.observer).peer().connected);
      if (nodes.simulator.now() == 3900ms) unacknowledged = nodes.near.path().unacknowledged_bytes;
    });
  }
  EXPECT_EQ(deliver(nodes, 100, {0ms, 2000ms, 5000ms}),
            (std::vector<Duration>{10ms, 4000ms, 5010ms}));
  EXPECT_EQ(unacknowledged, 0u);
  EXPECT_EQ(connected, (std::vector<bool>{true, false, false, true}));
}

TEST(VirtualNetwork, EqualSeedsLoseTheSamePackets) {
  const auto run = [] {
    Nodes nodes(constant(10, 20, 0.1), constant(10, 0, 0.1));
    return deliver(nodes, 50'000, {0ms, 200ms, 700ms});
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace slambed
