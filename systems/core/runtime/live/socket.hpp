// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/time.hpp"

namespace slambed {

struct Endpoint {
  std::string address;  ///< numeric IPv4 or IPv6 address
  std::uint16_t port = 0;
};

/// Throws bad_input unless the address is numeric.
void check_address(const Endpoint& endpoint);
/// Returns a listening, non-blocking socket. Throws environment_error if the address is not
/// available.
FileDescriptor listen_on(const Endpoint& endpoint);
std::uint16_t local_port(int fd);

/// Starts a non-blocking connect. Returns an empty descriptor if it fails at once (no route yet).
FileDescriptor begin_connect(const Endpoint& endpoint);
/// Returns the result of the connect once the socket is writable: 0 or an errno.
int connect_error(int fd);

/// Sets the options of every connection: no Nagle delay, the given congestion control, a bound on
/// unsent bytes in the kernel (so that our newest-wins queues decide) and detection of dead peers.
/// Returns the options that could not be set, or an empty string.
std::string tune_connection(int fd, const std::string& congestion_control);
/// Sets TCP_QUICKACK. The kernel resets it, so it is set again after each read.
void acknowledge_now(int fd);

/// tcpi_rtt, absent before the first sample.
std::optional<Duration> smoothed_rtt(int fd);
/// Bytes handed to the kernel that the peer has not acknowledged.
std::uint64_t unacknowledged_bytes(int fd);

}  // namespace slambed
