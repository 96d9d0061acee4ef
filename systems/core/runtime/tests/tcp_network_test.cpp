// SPDX-License-Identifier: Apache-2.0
#include "runtime/tests/tcp_nodes.hpp"

#include <netinet/tcp.h>

#include "base/error.hpp"

namespace slambed {
namespace {

using namespace testing;
using namespace std::chrono_literals;

TEST(TcpNetwork, MessagesGoBothWaysInOrderWithTheirStamps) {
  Node edge(true, 0);
  Node mobile(false, edge.port());
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  ASSERT_TRUE(edge.network->wait_connected(kLong));
  for (int i = 0; i < 200; ++i) {
    mobile.channel->send(3, Bytes(static_cast<std::size_t>(i * 100), static_cast<std::uint8_t>(i)));
  }
  for (int i = 0; i < 200; ++i) {
    const auto message = await_message(edge);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->type, 3);
    EXPECT_EQ(message->sequence, static_cast<std::uint64_t>(i + 1));
    EXPECT_EQ(message->payload.size(), static_cast<std::size_t>(i * 100));
    EXPECT_LE(message->queued, message->sent);
    if (i > 0) {
      EXPECT_EQ(message->payload[0], i);
    }
  }
  edge.channel->send(4, {1, 2, 3});
  const auto answer = await_message(mobile);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->payload, (Bytes{1, 2, 3}));
  ASSERT_TRUE(eventually([&] { return mobile.channel->path().unacknowledged_bytes == 0; }));
  ASSERT_TRUE(mobile.channel->path().smoothed_rtt);
  EXPECT_GT(*mobile.channel->path().smoothed_rtt, 0ns);
  EXPECT_LT(*mobile.channel->path().smoothed_rtt, 1s);
  EXPECT_EQ(edge.recorder.messages().size(), 200u);
  EXPECT_EQ(edge.recorder.messages()[1].bytes, 100 + FrameHeader::kSize);
}

TEST(TcpNetwork, LargeMessageArrivesWhole) {
  Node edge(true, 0);
  Node mobile(false, edge.port());
  Bytes big(20u << 20);
  for (std::size_t i = 0; i < big.size(); ++i)
    big[i] = static_cast<std::uint8_t>(i * 2654435761u >> 24);
  mobile.channel->send(1, big);
  const auto message = await_message(edge);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->payload, big);
}

TEST(TcpNetwork, FullSendQueueDropsTheOldestAndRecordsIt) {
  Node mobile(false, 1, {.name = "k", .send_queue = 2});  // no edge listens on port 1
  for (std::uint8_t i = 1; i <= 5; ++i) mobile.channel->send(i, {i});
  const auto records = mobile.recorder.messages();
  ASSERT_EQ(records.size(), 3u);
  for (std::size_t i = 0; i < records.size(); ++i) {
    EXPECT_TRUE(records[i].dropped);
    EXPECT_FALSE(records[i].incoming);
    EXPECT_EQ(records[i].type, i + 1);
    EXPECT_EQ(records[i].sequence, i + 1);
  }
}

TEST(TcpNetwork, NoTransferStartsWhileTheChannelIsHeld) {
  Node edge(true, 0);
  Node mobile(false, edge.port());
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  mobile.channel->hold(true);
  mobile.channel->send(1, {1});
  edge.channel->send(2, {2});  // the other direction is not held
  ASSERT_TRUE(await_message(mobile));
  EXPECT_FALSE(edge.channel->try_receive());
  EXPECT_GT(mobile.channel->path().unacknowledged_bytes, 0u);
  const RunTime released = mobile.runtime.now();
  mobile.channel->hold(false);
  const auto message = await_message(edge);
  ASSERT_TRUE(message);
  EXPECT_LT(message->queued, released);
  EXPECT_GE(message->sent, released);
}

TEST(TcpNetwork, FullReceiveQueueKeepsTheNewest) {
  Node edge(true, 0, {.name = "k", .receive_queue = 1});
  Node mobile(false, edge.port());
  for (std::uint8_t i = 1; i <= 5; ++i) mobile.channel->send(i, {});
  ASSERT_TRUE(eventually([&] { return edge.recorder.messages().size() == 4; }));
  const auto message = await_message(edge);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->type, 5);
  const auto records = edge.recorder.messages();
  ASSERT_EQ(records.size(), 5u);
  EXPECT_TRUE(records[0].dropped && records[0].incoming);
  EXPECT_FALSE(records[4].dropped);
}

TEST(TcpNetwork, ReconnectsToARestartedPeerAndGoesOn) {
  auto edge = std::make_unique<Node>(true, 0);
  const std::uint16_t port = edge->port();
  Node mobile(false, port);
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  mobile.channel->send(1, {});
  ASSERT_TRUE(await_message(*edge));
  edge->channel->send(2, {});
  ASSERT_TRUE(await_message(mobile));
  edge.reset();
  ASSERT_TRUE(eventually([&] { return mobile.recorder.saw_link("lost"); }));
  EXPECT_FALSE(mobile.channel->path().connected);
  mobile.channel->send(3, {9});  // waits for the connection
  edge = std::make_unique<Node>(true, port);
  const auto message = await_message(*edge);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->type, 3);
  EXPECT_TRUE(eventually([&] { return mobile.recorder.saw_link("reconnected"); }));
  edge->channel->send(4, {});  // its sequence starts at 1 again but is not taken for a duplicate
  ASSERT_TRUE(await_message(mobile));
}

TEST(TcpNetwork, GarbageIsRejectedAndTheChannelGoesOn) {
  Node edge(true, 0);
  Node mobile(false, edge.port());
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  const int fd = raw_connection(edge.port());
  write_all(fd, Bytes(1000, 'x'));
  EXPECT_TRUE(
      eventually([&] { return edge.recorder.saw_link("rejected: not a slambed message"); }));
  mobile.channel->send(1, {5});
  EXPECT_TRUE(await_message(edge));
  EXPECT_FALSE(edge.recorder.saw_link("lost"));
  ::close(fd);
}

TEST(TcpNetwork, StrangersAreTurnedAway) {
  Node edge(true, 0);
  const int silent = raw_connection(edge.port());
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("no greeting in time"); }));
  const int impatient = raw_connection(edge.port());
  write_frame(impatient, {.type = 1}, {1, 2, 3});
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("message before the greeting"); }));
  const int greedy = raw_connection(edge.port());
  FrameHeader header{.flags = FrameHeader::kGreetingFlag};
  header.length = 0xffffffff;
  write_all(greedy, header.encode());
  EXPECT_TRUE(
      eventually([&] { return edge.recorder.saw_link("4294967295 bytes is over the limit"); }));
  Node other(false, edge.port(), {.name = "k"}, "run-2");
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("rejected: wrong run key"); }));
  EXPECT_FALSE(edge.recorder.saw_link("connected:"));
  for (const int fd : {silent, impatient, greedy}) ::close(fd);
}

TEST(TcpNetwork, BadMessagesOfAGreetedPeerEndTheConnection) {
  Node edge(true, 0, {.name = "k", .max_payload = 1000});
  const std::string key = "run-1";
  const auto greeted = [&] {
    const int fd = raw_connection(edge.port());
    write_frame(fd, {.flags = FrameHeader::kGreetingFlag, .sequence = 77},
                Bytes(key.begin(), key.end()));
    return fd;
  };
  const int large = greeted();
  write_frame(large, {.type = 1, .sequence = 1}, Bytes(1001));
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("1001 bytes is over the limit"); }));
  const int corrupt = greeted();
  FrameHeader header{.type = 1, .sequence = 2};
  header.length = 3;
  header.payload_crc = 1;
  write_all(corrupt, header.encode());
  write_all(corrupt, Bytes{1, 2, 3});
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("payload checksum is wrong"); }));
  const int good = greeted();
  write_frame(good, {.type = 9, .sequence = 3}, {1});
  const auto message = await_message(edge);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->type, 9);
  for (const int fd : {large, corrupt, good}) ::close(fd);
}

TEST(TcpNetwork, SocketsUseThePinnedCongestionControlWithoutDelay) {
  Node edge(true, 0);
  const int peer = raw_connection(edge.port());
  // Not the cubic of live runs, which some hosts allow to root alone.
  EXPECT_EQ(tune_connection(peer, "reno"), "");
  char name[16] = {};
  socklen_t length = sizeof name;
  ASSERT_EQ(::getsockopt(peer, IPPROTO_TCP, TCP_CONGESTION, name, &length), 0);
  EXPECT_STREQ(name, "reno");
  EXPECT_NE(tune_connection(peer, "no-such").find("congestion control no-such"), std::string::npos);
  ::close(peer);
}

TEST(TcpNetwork, TakenPortAndBadAddressAreOneLineErrors) {
  Node edge(true, 0);
  try {
    Node second(true, edge.port());
    FAIL() << "the port was free";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kEnvironment);
    EXPECT_NE(std::string(error.what()).find(std::to_string(edge.port())), std::string::npos);
  }
  Recorder recorder;
  LiveRuntime runtime(recorder);
  TcpNetwork network(runtime, recorder, {.address = "edge.local", .ports = {{"k", 1}}},
                     same_key(""));
  EXPECT_THROW(network.open({.name = "k"}), Error);
  EXPECT_THROW(network.open({.name = "unknown"}), Error);
}

TEST(TcpNetwork, CloseSendsWhatIsQueued) {
  Node edge(true, 0);
  auto mobile = std::make_unique<Node>(false, edge.port());
  ASSERT_TRUE(mobile->network->wait_connected(kLong));
  mobile->channel->send(1, Bytes(5u << 20));
  mobile->network->close(kLong);
  const auto message = await_message(edge);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->payload.size(), 5u << 20);
}

TEST(TcpNetwork, APeerThatMeansToCloseIsNotLost) {
  Node edge(true, 0);
  auto mobile = std::make_unique<Node>(false, edge.port());
  ASSERT_TRUE(edge.network->wait_connected(kLong));
  // A peer that is not connected yet does not announce its close.
  ASSERT_TRUE(mobile->network->wait_connected(kLong));
  mobile->network->close(kLong);
  EXPECT_TRUE(eventually([&] { return !edge.channel->path().connected; }));
  EXPECT_FALSE(edge.recorder.saw_link("lost"));
  Node again(false, edge.port());  // dies without announcing its close
  ASSERT_TRUE(again.network->wait_connected(kLong));
  // The edge can lose the connection only after it has accepted it.
  ASSERT_TRUE(eventually([&] { return edge.channel->path().connected; }));
  again.network->close(Duration::zero());
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("lost"); }));
}

TEST(TcpNetwork, WaitForConnectionEndsWithTheRun) {
  Node mobile(false, 1);
  EXPECT_FALSE(mobile.network->wait_connected(10ms));
  mobile.runtime.stop();
  EXPECT_FALSE(mobile.network->wait_connected(kLong));
}

}  // namespace
}  // namespace slambed
