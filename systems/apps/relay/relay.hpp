// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "apps/relay/config.hpp"
#include "apps/relay/packet_log.hpp"
#include "apps/relay/pipe.hpp"
#include "apps/relay/tun.hpp"

namespace slambed::relay {

/// The whole link: two devices, two pipes and one loop that serves them until a signal ends it.
///
/// Standard input takes one command per line. `apply`: from now on the profile's value at time 0
/// applies; before, the link adds no delay. `start N`: run time 0 is at N ns on CLOCK_MONOTONIC.
class Relay {
 public:
  explicit Relay(const RelayOptions& options);

  /// Prints the ready line, then runs until SIGTERM or SIGINT (blocked by the caller).
  /// Throws Error with code kPeer if a device disappears.
  void run();

  /// Closes the packet log and writes the counters as JSON to options.summary. Throws
  /// environment_error if one of them cannot be written.
  void finish();

 private:
  void announce() const;
  void take_real_time_priority();
  void obey(const std::string& line);
  void read_commands();
  void poll_start_file();
  void arm_timer(std::int64_t next_due_ns);
  void serve_events(int timeout_ms);
  void start(std::int64_t t0_ns);

  RelayOptions options_;
  PacketLog log_;
  TunDevice mobile_;
  TunDevice edge_;
  Pipe up_;
  Pipe down_;
  FileDescriptor epoll_;
  FileDescriptor timer_;
  FileDescriptor signals_;
  FileDescriptor parent_;  ///< readable once the harness has ended, even by SIGKILL
  std::string command_;    ///< received part of the next command line
  bool real_time_ = false;
  bool started_ = false;
  bool stopped_ = false;
  std::int64_t armed_ns_ = Pipe::kNothingDue;
};

}  // namespace slambed::relay
