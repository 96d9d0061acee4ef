// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "apps/relay/config.hpp"
#include "apps/relay/packet_log.hpp"
#include "apps/relay/pipe.hpp"
#include "apps/relay/tun.hpp"

namespace slambed::relay {

/// The whole link: two devices, two pipes and one loop that serves them until a signal ends it.
///
/// Commands on standard input, one a line: `apply` (the profile's value at time 0 holds from now
/// on; before, the link adds no delay) and `start N` (run time 0 is N on CLOCK_MONOTONIC, in
/// nanoseconds).
class Relay {
 public:
  explicit Relay(const RelayOptions& options);

  /// Prints the ready line, then runs until SIGTERM or SIGINT (blocked by the caller).
  /// Throws Error with code kPeer when a device disappears.
  void run();

  /// Closes the packet log and writes the counters as JSON to options.summary. Throws
  /// environment_error when one of them cannot be written.
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
  FileDescriptor parent_;  ///< readable once the harness has ended, after kill -9 too
  std::string command_;    ///< what came of the next line so far
  bool real_time_ = false;
  bool started_ = false;
  bool stopped_ = false;
  std::int64_t armed_ns_ = Pipe::kNothingDue;
};

}  // namespace slambed::relay
