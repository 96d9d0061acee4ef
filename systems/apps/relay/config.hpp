// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>
#include <cstdint>
#include <string>

#include "link/direction.hpp"

namespace slambed::relay {

using link::DirectionOptions;

/// Where one end of the link lives.
struct EndOptions {
  std::string network_namespace;  ///< path, e.g. /proc/123/ns/net or /run/netns/mobile
  std::string device;             ///< name of the TUN device made there
  std::string address;            ///< IPv4
};

struct RelayOptions {
  EndOptions mobile;
  EndOptions edge;
  int prefix_length = 30;
  int mtu = 1500;
  int tx_queue_packets = 10000;  ///< what the kernel holds for us while we are not running
  std::uint64_t seed = 1;
  DirectionOptions up;    ///< mobile to edge
  DirectionOptions down;  ///< edge to mobile
  std::int64_t spin_ns = 60'000;
  int fifo_priority = 0;   ///< 0: ordinary scheduling
  pid_t parent_pid = 0;    ///< end when this process is gone; 0: any parent
  std::string start_file;  ///< polled for t0_ns; empty: only standard input tells
  std::string packet_log;
  std::string summary;
};

/// Reads and checks the whole configuration. Throws bad_input with one line.
RelayOptions read_config(const std::string& path);

/// t0_ns of a start.json; throws bad_input when it is not one.
std::int64_t read_start_file(const std::string& path);

}  // namespace slambed::relay
