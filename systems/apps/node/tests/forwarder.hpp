// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <deque>

#include "apps/node/tests/sockets.hpp"

namespace slambed::testing {

/// Forwards TCP connections between two loopback ports with a delay, in order. While it is cut, no
/// byte passes. If one side closes, so does the other.
class Forwarder {
 public:
  Forwarder(int from, int to) : to_(to) {
    listener_ = ::socket(AF_INET, SOCK_STREAM, 0);
    const int on = 1;
    ::setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    const sockaddr_in address = loopback(from);
    ready_ = ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
             ::listen(listener_, 4) == 0;
    thread_ = std::thread([this] { accept_all(); });
  }
  ~Forwarder() {
    stop_ = true;
    thread_.join();
    for (auto& pair : pairs_) pair.join();
    ::close(listener_);
  }
  Forwarder(const Forwarder&) = delete;
  Forwarder& operator=(const Forwarder&) = delete;

  bool ready() const { return ready_; }
  void set_one_way(std::chrono::milliseconds delay) { delay_ms_ = delay.count(); }
  void cut(bool is_cut) { cut_ = is_cut; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Chunk {
    Clock::time_point due;
    std::vector<char> bytes;
  };
  /// One direction of one connection.
  struct Way {
    int from, to;
    std::deque<Chunk> under_way;
    bool ended = false;
  };

  void accept_all() {
    while (!stop_) {
      pollfd waiting{listener_, POLLIN, 0};
      if (::poll(&waiting, 1, 20) <= 0) continue;
      const int client = ::accept(listener_, nullptr, nullptr);
      if (client < 0) continue;
      pairs_.emplace_back([this, client] { carry(client); });
    }
  }

  void carry(int client) {
    const int server = connect_to(to_);
    if (server >= 0) {
      Way up{client, server, {}}, down{server, client, {}};
      while (!stop_ && !up.ended && !down.ended) {
        pollfd waiting[] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
        ::poll(waiting, 2, 1);
        if (waiting[0].revents != 0) read_from(up);
        if (waiting[1].revents != 0) read_from(down);
        hand_out(up);
        hand_out(down);
      }
    }
    ::close(client);
    if (server >= 0) ::close(server);
  }

  void read_from(Way& way) const {
    std::vector<char> bytes(65536);
    const auto got = ::recv(way.from, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (got == 0) way.ended = true;
    if (got <= 0) return;
    bytes.resize(static_cast<std::size_t>(got));
    way.under_way.push_back(
        {Clock::now() + std::chrono::milliseconds(delay_ms_), std::move(bytes)});
  }

  void hand_out(Way& way) const {
    while (!cut_ && !way.under_way.empty() && way.under_way.front().due <= Clock::now()) {
      Chunk& chunk = way.under_way.front();
      const auto put =
          ::send(way.to, chunk.bytes.data(), chunk.bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
      if (put < 0) return;
      chunk.bytes.erase(chunk.bytes.begin(), chunk.bytes.begin() + put);
      if (!chunk.bytes.empty()) return;
      way.under_way.pop_front();
    }
  }

  int to_;
  int listener_ = -1;
  bool ready_ = false;
  std::atomic<bool> stop_{false}, cut_{false};
  std::atomic<std::int64_t> delay_ms_{0};
  std::thread thread_;
  std::vector<std::thread> pairs_;
};

}  // namespace slambed::testing
