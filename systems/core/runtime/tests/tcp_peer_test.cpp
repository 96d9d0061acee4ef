// SPDX-License-Identifier: Apache-2.0
// What the network reports about a peer that dies, freezes or comes back.
#include "runtime/tests/tcp_nodes.hpp"

namespace slambed {
namespace {

using namespace testing;
using namespace std::chrono_literals;

const std::vector<ChannelOptions> kChannels = {{.name = "a"}, {.name = "b"}};
const std::vector<ChannelOptions> kWatched = {{.name = "a", .heartbeat = true}, {.name = "b"}};

/// A peer whose program is frozen: it has sent its greeting, and only its kernel still answers.
class FrozenPeer {
 public:
  FrozenPeer(const Node& edge, const std::string& channel, std::uint64_t session)
      : fd_(raw_connection(edge.port(channel))) {
    const std::string key = "run-1";
    write_frame(fd_, {.flags = FrameHeader::kGreetingFlag, .sequence = session},
                Bytes(key.begin(), key.end()));
  }
  ~FrozenPeer() { ::close(fd_); }
  FrozenPeer(const FrozenPeer&) = delete;
  FrozenPeer& operator=(const FrozenPeer&) = delete;
  /// Returns the sequence of the next message.
  std::uint64_t receive() {
    for (;;) {
      std::array<std::uint8_t, FrameHeader::kSize> bytes{};
      EXPECT_TRUE(read_all(bytes));
      const auto decoded = FrameHeader::decode(bytes);
      const auto* header = std::get_if<FrameHeader>(&decoded);
      if (!header) {
        ADD_FAILURE() << std::get<std::string>(decoded);
        return 0;
      }
      Bytes payload(header->length);
      EXPECT_TRUE(read_all(payload));
      if (header->flags == 0) return header->sequence;
    }
  }
  void send_heartbeat() { write_frame(fd_, {.flags = FrameHeader::kAliveFlag}, {}); }

 private:
  bool read_all(std::span<std::uint8_t> into) const {
    if (into.empty()) return true;  // recv blocks even for zero bytes
    const auto n = ::recv(fd_, into.data(), into.size(), MSG_WAITALL);
    return n == static_cast<ssize_t>(into.size());
  }

  int fd_;
};

Node::Ports ports_of(const Node& edge) { return {{"a", edge.port("a")}, {"b", edge.port("b")}}; }

bool connected(const Node& node) { return node.network->peer().connected; }

TEST(TcpPeer, IsConnectedOnceAllChannelsAre) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kChannels);
  EXPECT_EQ(edge.network->peer(), PeerState{});
  FrozenPeer a(edge, "a", 77);
  ASSERT_TRUE(eventually([&] { return edge.network->peer().session == 1; }));
  EXPECT_FALSE(connected(edge));
  const auto ticket = edge.network->peer_signal().ticket();
  FrozenPeer b(edge, "b", 77);
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  EXPECT_EQ(edge.network->peer().session, 1u);
  EXPECT_NE(edge.network->peer_signal().ticket(), ticket);
}

TEST(TcpPeer, SignsOfLifeKeepIdleNodesConnected) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kWatched);
  Node mobile(false, ports_of(edge), kWatched);
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  std::this_thread::sleep_for(1500ms);  // more than twice the silence limit
  EXPECT_TRUE(connected(mobile) && connected(edge));
  EXPECT_FALSE(mobile.recorder.saw_link("silent") || edge.recorder.saw_link("silent"));
  EXPECT_TRUE(mobile.recorder.messages().empty() && edge.recorder.messages().empty());
}

TEST(TcpPeer, AFrozenOneIsAwayUntilItShowsLife) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kWatched);
  FrozenPeer a(edge, "a", 77), b(edge, "b", 77);
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  ASSERT_TRUE(eventually([&] { return !connected(edge); }));
  EXPECT_TRUE(edge.recorder.saw_link("silent"));
  EXPECT_FALSE(edge.recorder.saw_link("lost"));
  EXPECT_TRUE(edge.channel->path().connected);  // the TCP connection still stands
  a.send_heartbeat();
  EXPECT_TRUE(eventually([&] { return connected(edge); }));
  EXPECT_TRUE(edge.recorder.saw_link("alive"));
  EXPECT_EQ(edge.network->peer().session, 1u);
}

TEST(TcpPeer, BytesThatNobodyAcknowledgesAreAStallUntilSomebodyDoes) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kChannels);
  FrozenPeer a(edge, "a", 77), b(edge, "b", 77);
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  edge.channel->send(1, Bytes(32'000'000));  // more than both kernels can buffer
  ASSERT_TRUE(eventually([&] { return edge.recorder.saw_link("stalled"); }));
  EXPECT_FALSE(edge.recorder.saw_link("flowing"));
  a.receive();
  EXPECT_TRUE(eventually([&] { return edge.recorder.saw_link("flowing"); }));
  EXPECT_TRUE(connected(edge));
}

TEST(TcpPeer, ARestartedOneHasANewSession) {
  auto edge = std::make_unique<Node>(true, Node::Ports{{"a", 0}, {"b", 0}}, kWatched);
  const Node::Ports ports = ports_of(*edge);
  Node mobile(false, ports, kWatched);
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  edge->channel->send(1, {});
  auto message = await_message(mobile);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->session, 1u);
  edge.reset();
  ASSERT_TRUE(eventually([&] { return !connected(mobile); }));
  EXPECT_EQ(mobile.network->peer().session, 1u);
  edge = std::make_unique<Node>(true, ports, kWatched);
  ASSERT_TRUE(mobile.network->wait_connected(kLong));
  EXPECT_EQ(mobile.network->peer().session, 2u);
  EXPECT_EQ(edge->network->peer().session, 1u);
  EXPECT_TRUE(eventually([&] { return mobile.recorder.saw_link("session 2"); }));
  edge->channel->send(1, {});
  message = await_message(mobile);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->session, 2u);
}

TEST(TcpPeer, AReconnectedOneIsTheSame) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kChannels);
  auto a = std::make_unique<FrozenPeer>(edge, "a", 77);
  FrozenPeer b(edge, "b", 77);
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  a.reset();
  ASSERT_TRUE(eventually([&] { return edge.recorder.saw_link("lost"); }));
  EXPECT_FALSE(connected(edge));
  a = std::make_unique<FrozenPeer>(edge, "a", 77);
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  EXPECT_EQ(edge.network->peer().session, 1u);
}

TEST(TcpPeer, WhatAReplacedConnectionDidNotTakeWholeIsTheFirstOnTheNext) {
  Node edge(true, {{"k", 0}}, {{.name = "k"}});
  FrozenPeer old(edge, "k", 77);
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  constexpr std::size_t kMoreThanTheKernelTakes = 48u << 20;
  const auto first = edge.channel->send(1, Bytes(kMoreThanTheKernelTakes));
  ASSERT_TRUE(eventually([&] {  // the transfer has started
    const auto waiting = edge.channel->path().unacknowledged_bytes;
    return waiting > 0 && waiting < kMoreThanTheKernelTakes;
  }));
  const auto second = edge.channel->send(1, {});
  FrozenPeer next(edge, "k", 77);  // before the edge notices the loss of the old one
  EXPECT_EQ(next.receive(), first);
  EXPECT_EQ(next.receive(), second);
}

TEST(TcpPeer, WhatIsLeftOfADeadProcessIsCutOff) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kChannels);
  FrozenPeer a(edge, "a", 77), b(edge, "b", 77);  // stay open, as the death was not noticed
  ASSERT_TRUE(eventually([&] { return connected(edge); }));
  FrozenPeer new_a(edge, "a", 88);
  ASSERT_TRUE(eventually([&] { return edge.recorder.saw_link("the peer was restarted"); }));
  EXPECT_EQ(edge.network->peer(), (PeerState{.connected = false, .session = 2}));
  FrozenPeer new_b(edge, "b", 88);
  EXPECT_TRUE(eventually([&] { return connected(edge); }));
  EXPECT_EQ(edge.network->peer().session, 2u);
}

TEST(TcpPeer, EveryLifeIsNumberedInItsMessages) {
  Node edge(true, {{"a", 0}, {"b", 0}}, kChannels);
  const Node::Ports ports = ports_of(edge);
  std::uint64_t sent = 0;
  for (std::uint64_t life = 1; life <= 20; ++life) {
    Node mobile(false, ports, kChannels);
    ASSERT_TRUE(mobile.network->wait_connected(kLong));
    ASSERT_TRUE(edge.network->wait_connected(kLong));
    mobile.channel->send(static_cast<std::uint8_t>(life), Bytes(100'000));
    mobile.network->close(kLong);
    ++sent;
  }
  for (std::uint64_t life = 1; life <= sent; ++life) {
    const auto message = await_message(edge);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->type, life);
    EXPECT_EQ(message->session, life);
  }
  EXPECT_EQ(edge.network->peer().session, sent);
}

}  // namespace
}  // namespace slambed
