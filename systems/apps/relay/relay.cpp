// SPDX-License-Identifier: Apache-2.0
#include "apps/relay/relay.hpp"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "apps/relay/clock.hpp"
#include "base/error.hpp"

namespace slambed::relay {
namespace {

constexpr std::size_t kLargestPacket = 65536;
constexpr int kBatch = 32;  // packets read from one side before the other side is read
constexpr std::int64_t kLongestUnservedNs = 2'000'000;  // for signals and commands under full load
constexpr std::int64_t kTimerExpired = Pipe::kNothingDue - 1;
constexpr int kStartFilePollMs = 20;  // the harness sets t0 further ahead than this

int stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGINT);
  return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

/// Returns a pidfd of the harness, so that the link does not outlive it. PR_SET_PDEATHSIG fires
/// when the harness's *thread* that started the relay ends, so it is only the fallback without
/// pidfd.
int watch_parent(pid_t parent) {
  if (parent == 0) parent = getppid();
  const auto fd = static_cast<int>(syscall(SYS_pidfd_open, parent, 0));
  if (fd >= 0) return fd;
  if (errno == ESRCH) {
    throw Error(ExitCode::kPeer,
                "the harness is gone, process " + std::to_string(parent) + ", start the run again");
  }
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  return -1;
}

nlohmann::json counters_json(const PipeCounters& counters) {
  return {{"packets", counters.packets},
          {"bytes", counters.bytes},
          {"delivered", counters.fates[0]},
          {"lost", counters.fates[1]},
          {"queue_full", counters.fates[2]},
          {"in_gap", counters.fates[3]},
          {"overflow", counters.fates[4]},
          {"write_errors", counters.write_errors},
          {"late_us_max", static_cast<double>(counters.late_ns_max) / 1e3},
          {"held_bytes_max", counters.held_bytes_max}};
}

}  // namespace

Relay::Relay(const RelayOptions& options)
    : options_(options),
      log_(options.packet_log),
      mobile_(options.mobile, options),
      edge_(options.edge, options),
      up_(options.up, options.seed, 0, mobile_.fd(), edge_.fd(), log_),
      down_(options.down, options.seed, 1, edge_.fd(), mobile_.fd(), log_),
      epoll_(epoll_create1(EPOLL_CLOEXEC)),
      timer_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)),
      signals_(stop_signals()),
      parent_(watch_parent(options.parent_pid)) {
  for (const int fd :
       {mobile_.fd(), edge_.fd(), timer_.get(), signals_.get(), parent_.get(), STDIN_FILENO}) {
    if (fd < 0) continue;
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = fd;
    // Standard input may be a file or /dev/null, which epoll refuses; then there are no commands.
    if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0 && fd != STDIN_FILENO) {
      throw environment_error(std::string("cannot watch the devices: ") + std::strerror(errno) +
                              ", epoll, check the limit on open files");
    }
  }
}

void Relay::take_real_time_priority() {
  if (options_.fifo_priority == 0) return;
  sched_param parameters{};
  parameters.sched_priority = options_.fifo_priority;
  real_time_ = sched_setscheduler(0, SCHED_FIFO, &parameters) == 0;
  if (real_time_) mlockall(MCL_CURRENT | MCL_FUTURE);
}

void Relay::announce() const {
  const nlohmann::json line = {{"ready", true}, {"pid", getpid()}, {"real_time", real_time_}};
  std::cout << line.dump() << std::endl;
}

void Relay::run() {
  take_real_time_priority();
  announce();
  std::array<std::uint8_t, kLargestPacket> buffer;
  std::int64_t served_ns = monotonic_ns();
  while (!stopped_) {
    up_.deliver_due();
    down_.deliver_due();
    const int moved = up_.take(kBatch, buffer) + down_.take(kBatch, buffer);
    const std::int64_t next_due_ns = std::min(up_.next_due_ns(), down_.next_due_ns());
    const std::int64_t now_ns = monotonic_ns();
    const bool soon = next_due_ns != Pipe::kNothingDue && next_due_ns - now_ns <= options_.spin_ns;
    if (moved == 0 && !soon) {
      arm_timer(next_due_ns);
      serve_events(!started_ && !options_.start_file.empty() ? kStartFilePollMs : -1);
      served_ns = monotonic_ns();
    } else if (now_ns - served_ns > kLongestUnservedNs) {
      serve_events(0);
      served_ns = now_ns;
    }
  }
}

void Relay::arm_timer(std::int64_t next_due_ns) {
  if (next_due_ns == armed_ns_) return;
  itimerspec at{};
  if (next_due_ns != Pipe::kNothingDue) {
    const std::int64_t wake_ns = next_due_ns - options_.spin_ns;
    at.it_value = {wake_ns / kNsPerSecond, wake_ns % kNsPerSecond};
  }
  timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &at, nullptr);
  armed_ns_ = next_due_ns;
}

void Relay::serve_events(int timeout_ms) {
  std::array<epoll_event, 8> events;
  const int count =
      epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), timeout_ms);
  for (int i = 0; i < count; ++i) {
    const int fd = events[static_cast<std::size_t>(i)].data.fd;
    if (fd == STDIN_FILENO) read_commands();
    if (fd == signals_.get() || fd == parent_.get()) stopped_ = true;
    // An expired timer is cleared only when it is armed again, even for the same time.
    if (fd == timer_.get()) armed_ns_ = kTimerExpired;
  }
  if (!started_ && !options_.start_file.empty()) poll_start_file();
}

void Relay::poll_start_file() {
  if (std::filesystem::exists(options_.start_file)) start(read_start_file(options_.start_file));
}

void Relay::read_commands() {
  std::array<char, 256> chunk;
  const ssize_t size = read(STDIN_FILENO, chunk.data(), chunk.size());
  if (size <= 0) {
    epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, STDIN_FILENO, nullptr);
    return;
  }
  for (const char letter : std::span(chunk).first(static_cast<std::size_t>(size))) {
    if (letter == '\n') {
      obey(command_);
      command_.clear();
    } else if (command_.size() < chunk.size()) {
      command_ += letter;
    }
  }
}

void Relay::obey(const std::string& line) {
  constexpr std::string_view kStart = "start ";
  if (line == "apply") {
    up_.model().apply_profile();
    down_.model().apply_profile();
    std::cout << R"({"applied": true})" << std::endl;
    return;
  }
  std::int64_t t0_ns = 0;
  const char* const end = line.data() + line.size();
  if (line.starts_with(kStart)) {
    const auto [stop, error] = std::from_chars(line.data() + kStart.size(), end, t0_ns);
    if (error == std::errc() && stop == end) {
      start(t0_ns);
      return;
    }
  }
  throw bad_input("unknown command '" + line + "', standard input, say 'apply' or 'start N'");
}

void Relay::start(std::int64_t t0_ns) {
  started_ = true;
  up_.model().start(t0_ns);
  down_.model().start(t0_ns);
  const nlohmann::json line = {{"started", true}, {"t0_ns", t0_ns}};
  std::cout << line.dump() << std::endl;
}

void Relay::finish() {
  log_.close();
  if (options_.summary.empty()) return;
  const DeviceDrops mobile = mobile_.drops();
  const DeviceDrops edge = edge_.drops();
  const nlohmann::json summary = {{"up", counters_json(up_.counters())},
                                  {"down", counters_json(down_.counters())},
                                  {"real_time", real_time_},
                                  {"seed", options_.seed},
                                  {"kernel_drops",
                                   {{"mobile_rx", mobile.rx},
                                    {"mobile_tx", mobile.tx},
                                    {"edge_rx", edge.rx},
                                    {"edge_tx", edge.tx}}}};
  std::ofstream file(options_.summary);
  file << summary.dump(1) << '\n';
  file.close();
  if (!file) {
    throw environment_error("cannot write the summary: " + options_.summary +
                            ", check the free space");
  }
}

}  // namespace slambed::relay
