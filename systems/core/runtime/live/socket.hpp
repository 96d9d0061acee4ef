// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/time.hpp"

namespace slambed {

struct Endpoint {
  std::string address;  ///< IPv4 or IPv6 in numbers
  std::uint16_t port = 0;
};

/// Throws bad_input when the address is not written in numbers.
void check_address(const Endpoint& endpoint);
/// A listening, non-blocking socket. Throws environment_error when the address cannot be had.
FileDescriptor listen_on(const Endpoint& endpoint);
std::uint16_t local_port(int fd);

/// Begins a non-blocking connect; an empty descriptor when that failed at once (no route yet).
FileDescriptor begin_connect(const Endpoint& endpoint);
/// Result of the connect once the socket is writable: 0 or an errno.
int connect_error(int fd);

/// What every connection of ours gets: no Nagle delay, the pinned congestion control, a bound on
/// unsent bytes in the kernel (so that our own newest-wins queues decide) and notice of dead peers.
/// Returns what could not be set, empty when all could.
std::string tune_connection(int fd, const std::string& congestion_control);
/// Acknowledge at once; the kernel forgets it, so it is asked again after each read.
void acknowledge_now(int fd);

/// tcpi_rtt, absent before the first sample.
std::optional<Duration> smoothed_rtt(int fd);
/// Bytes handed to the kernel that the peer has not acknowledged.
std::uint64_t unacknowledged_bytes(int fd);

}  // namespace slambed
