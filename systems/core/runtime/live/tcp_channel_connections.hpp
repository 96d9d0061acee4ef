// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <poll.h>

#include <memory>
#include <string>
#include <vector>

#include "runtime/live/socket.hpp"
#include "runtime/live/tcp_network.hpp"
#include "runtime/stall_watch.hpp"

namespace slambed {

/// One channel with its sockets. Only the current connection has an accepted greeting.
struct TcpNetwork::ChannelConnections {
  /// A flood of garbage must not fill the disk through the event log.
  static constexpr int kMaxRejectionsRecorded = 100;

  std::unique_ptr<TcpChannel> channel;
  Endpoint endpoint;
  FileDescriptor listener;
  FileDescriptor connecting;
  RunTime next_attempt{};  ///< monotonic
  RunTime attempt_until{};
  std::vector<std::unique_ptr<TcpConnection>> connections;
  TcpConnection* current = nullptr;
  bool ever_connected = false;
  std::uint64_t peer_session_id = 0;
  std::uint64_t session = 0;
  int rejections = 0;
  StallWatch stall;
  std::uint64_t acknowledged = 0;  ///< bytes, of the current connection at the last check
  std::string untuned;             ///< socket options that the host refused

  void reject(const std::string& reason) {
    if (++rejections <= kMaxRejectionsRecorded) channel->record_link("rejected", reason);
  }
};

struct TcpNetwork::PollSet {
  std::vector<pollfd> fds;
  void add(int fd, short events) { fds.push_back({fd, events, 0}); }
  short result(int fd) const {
    for (const pollfd& entry : fds) {
      if (entry.fd == fd) return entry.revents;
    }
    return 0;
  }
};

}  // namespace slambed
