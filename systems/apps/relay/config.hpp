// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>
#include <cstdint>
#include <string>

#include "link/direction.hpp"

namespace slambed::relay {

using link::DirectionOptions;

/// One end of the link.
struct EndOptions {
  std::string network_namespace;  ///< path, e.g. /proc/123/ns/net or /run/netns/mobile
  std::string device;             ///< name of the TUN device to make there
  std::string address;            ///< IPv4
};

struct RelayOptions {
  EndOptions mobile;
  EndOptions edge;
  int prefix_length = 30;
  int mtu = 1500;
  int tx_queue_packets = 10000;  ///< kernel queue for the time when the relay is not scheduled
  std::uint64_t seed = 1;
  DirectionOptions up;    ///< mobile to edge
  DirectionOptions down;  ///< edge to mobile
  std::int64_t spin_ns = 60'000;
  int fifo_priority = 0;   ///< 0: normal scheduling
  pid_t parent_pid = 0;    ///< the relay ends with this process; 0: with its parent
  std::string start_file;  ///< polled for t0_ns; empty: t0 comes only by standard input
  std::string packet_log;
  std::string summary;
};

/// Reads and checks the whole configuration. Throws bad_input with one line.
RelayOptions read_config(const std::string& path);

/// Returns t0_ns of a start.json. Throws bad_input for an invalid file.
std::int64_t read_start_file(const std::string& path);

}  // namespace slambed::relay
