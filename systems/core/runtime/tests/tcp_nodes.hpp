// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <thread>

#include "runtime/frame_header.hpp"
#include "runtime/live/tcp_network.hpp"
#include "runtime/tests/recorder.hpp"

namespace slambed::testing {

using namespace std::chrono_literals;
inline constexpr auto kLong = 10s;  ///< a limit that a passing test does not reach

inline Greeting same_key(const std::string& key) {
  return {.own = [key](const std::string&) { return Bytes(key.begin(), key.end()); },
          .check = [key](const std::string&,
                         std::span<const std::uint8_t> payload) -> std::optional<std::string> {
            if (std::string(payload.begin(), payload.end()) == key) return std::nullopt;
            return "wrong run key";
          }};
}

/// One node's runtime and network, mostly with the single channel "k". `channel` is the first one.
struct Node {
  using Ports = std::map<std::string, std::uint16_t>;
  Recorder recorder;
  LiveRuntime runtime{recorder};
  std::unique_ptr<TcpNetwork> network;
  Channel* channel = nullptr;

  Node(bool listens, std::uint16_t port, ChannelOptions options = {.name = "k"},
       const std::string& key = "run-1")
      : Node(listens, Ports{{"k", port}}, {std::move(options)}, key) {}

  Node(bool listens, const Ports& ports, const std::vector<ChannelOptions>& channels,
       const std::string& key = "run-1") {
    runtime.set_origin(monotonic_now());
    network = std::make_unique<TcpNetwork>(runtime, recorder,
                                           TcpNetworkOptions{.listens = listens,
                                                             .address = "127.0.0.1",
                                                             .ports = ports,
                                                             .retry = 5ms,
                                                             .greeting_limit = 300ms,
                                                             .heartbeat = 50ms,
                                                             .silence = 600ms},
                                           same_key(key));
    for (const auto& options : channels) {
      Channel& opened = network->open(options);
      if (!channel) channel = &opened;
    }
    network->start();
  }
  std::uint16_t port(const std::string& name = "k") const { return network->port(name); }
};

inline std::optional<Message> await_message(Node& node, Duration limit = kLong) {
  const auto deadline = monotonic_now() + limit;
  while (monotonic_now() < deadline) {
    if (auto message = node.channel->try_receive()) return message;
    std::this_thread::sleep_for(1ms);
  }
  return std::nullopt;
}

template <typename Condition>
bool eventually(Condition condition) {
  const auto deadline = monotonic_now() + kLong;
  while (!condition()) {
    if (monotonic_now() >= deadline) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

inline int raw_connection(std::uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  return fd;
}

inline void write_all(int fd, std::span<const std::uint8_t> bytes) {
  [[maybe_unused]] const auto n = ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
}

inline void write_frame(int fd, FrameHeader header, const Bytes& payload) {
  header.length = static_cast<std::uint32_t>(payload.size());
  header.payload_crc = checksum(payload);
  write_all(fd, header.encode());
  write_all(fd, payload);
}

}  // namespace slambed::testing
