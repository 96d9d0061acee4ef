// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/socket.hpp"

#include <arpa/inet.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr int kBacklog = 8;
/// Enough to keep a 1 Gbit/s, 1 ms path busy between two wake-ups.
constexpr int kUnsentBytes = 128 * 1024;
/// A peer that acknowledges nothing for this long counts as gone. A shorter outage does not break
/// the connection: TCP retransmits and messages wait.
constexpr int kUserTimeoutMs = 20'000;
constexpr int kKeepIdleS = 5, kKeepIntervalS = 5, kKeepCount = 3;

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length = 0;
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
};

SocketAddress parse(const Endpoint& endpoint) {
  SocketAddress result;
  in_addr v4{};
  in6_addr v6{};
  if (inet_pton(AF_INET, endpoint.address.c_str(), &v4) == 1) {
    auto& address = reinterpret_cast<sockaddr_in&>(result.storage);
    address.sin_family = AF_INET;
    address.sin_addr = v4;
    address.sin_port = htons(endpoint.port);
    result.length = sizeof(sockaddr_in);
  } else if (inet_pton(AF_INET6, endpoint.address.c_str(), &v6) == 1) {
    auto& address = reinterpret_cast<sockaddr_in6&>(result.storage);
    address.sin6_family = AF_INET6;
    address.sin6_addr = v6;
    address.sin6_port = htons(endpoint.port);
    result.length = sizeof(sockaddr_in6);
  } else {
    throw bad_input("network.edge_address: '" + endpoint.address +
                    "' is no IP address; write it in numbers, e.g. 10.77.0.2");
  }
  return result;
}

FileDescriptor stream_socket(int family) {
  return FileDescriptor(::socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

bool set_int(int fd, int level, int name, int value) {
  return ::setsockopt(fd, level, name, &value, sizeof value) == 0;
}

}  // namespace

void check_address(const Endpoint& endpoint) { parse(endpoint); }

FileDescriptor listen_on(const Endpoint& endpoint) {
  const SocketAddress address = parse(endpoint);
  FileDescriptor fd = stream_socket(address.storage.ss_family);
  set_int(fd.get(), SOL_SOCKET, SO_REUSEADDR, 1);
  if (::bind(fd.get(), address.get(), address.length) != 0 || ::listen(fd.get(), kBacklog) != 0) {
    throw environment_error("cannot listen on " + endpoint.address + " port " +
                            std::to_string(endpoint.port) + ": " + error_text(errno) +
                            "; choose another port under network.ports or end what uses it");
  }
  return fd;
}

std::uint16_t local_port(int fd) {
  sockaddr_storage storage{};
  socklen_t length = sizeof storage;
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&storage), &length) != 0) return 0;
  return storage.ss_family == AF_INET6
             ? ntohs(reinterpret_cast<const sockaddr_in6&>(storage).sin6_port)
             : ntohs(reinterpret_cast<const sockaddr_in&>(storage).sin_port);
}

FileDescriptor begin_connect(const Endpoint& endpoint) {
  const SocketAddress address = parse(endpoint);
  FileDescriptor fd = stream_socket(address.storage.ss_family);
  const bool begun =
      fd && (::connect(fd.get(), address.get(), address.length) == 0 || errno == EINPROGRESS);
  return begun ? std::move(fd) : FileDescriptor();
}

int connect_error(int fd) {
  int error = 0;
  socklen_t length = sizeof error;
  if (::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &length) != 0) return errno;
  return error;
}

std::string tune_connection(int fd, const std::string& congestion_control) {
  std::string failed;
  const auto check = [&](bool done, const char* what) {
    if (!done) failed += (failed.empty() ? "" : ", ") + std::string(what);
  };
  check(set_int(fd, IPPROTO_TCP, TCP_NODELAY, 1), "TCP_NODELAY");
  check(::setsockopt(fd, IPPROTO_TCP, TCP_CONGESTION, congestion_control.data(),
                     static_cast<socklen_t>(congestion_control.size())) == 0,
        ("congestion control " + congestion_control).c_str());
  check(set_int(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, kUnsentBytes), "TCP_NOTSENT_LOWAT");
  check(set_int(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, kUserTimeoutMs), "TCP_USER_TIMEOUT");
  check(set_int(fd, SOL_SOCKET, SO_KEEPALIVE, 1) &&
            set_int(fd, IPPROTO_TCP, TCP_KEEPIDLE, kKeepIdleS) &&
            set_int(fd, IPPROTO_TCP, TCP_KEEPINTVL, kKeepIntervalS) &&
            set_int(fd, IPPROTO_TCP, TCP_KEEPCNT, kKeepCount),
        "keep-alive");
  acknowledge_now(fd);
  return failed;
}

void acknowledge_now(int fd) { set_int(fd, IPPROTO_TCP, TCP_QUICKACK, 1); }

std::optional<Duration> smoothed_rtt(int fd) {
  tcp_info info{};
  socklen_t length = sizeof info;
  if (::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &length) != 0 || info.tcpi_rtt == 0) {
    return std::nullopt;
  }
  return std::chrono::microseconds(info.tcpi_rtt);
}

std::uint64_t unacknowledged_bytes(int fd) {
  int bytes = 0;
  return ::ioctl(fd, SIOCOUTQ, &bytes) == 0 && bytes > 0 ? static_cast<std::uint64_t>(bytes) : 0;
}

}  // namespace slambed
