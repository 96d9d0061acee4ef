// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/tcp_network.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/error.hpp"
#include "runtime/live/tcp_channel_connections.hpp"

namespace slambed {
namespace {

constexpr Duration kLookEvery = std::chrono::milliseconds(100);
constexpr Duration kLookEveryClosing = std::chrono::milliseconds(5);

}  // namespace

TcpNetwork::TcpNetwork(LiveRuntime& runtime, Observer& observer, TcpNetworkOptions options,
                       Greeting greeting)
    : runtime_(runtime),
      observer_(observer),
      options_(std::move(options)),
      greeting_(std::move(greeting)),
      session_id_(static_cast<std::uint64_t>(monotonic_now().count()) ^
                  (static_cast<std::uint64_t>(::getpid()) << 48)),
      wake_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      peer_signal_(runtime.make_signal()) {
  if (!wake_)
    throw environment_error("eventfd: " + error_text(errno) + "; raise the limit of open files");
}

TcpNetwork::~TcpNetwork() { close(Duration::zero()); }

Channel& TcpNetwork::open(const ChannelOptions& options) {
  const auto port = options_.ports.find(options.name);
  if (port == options_.ports.end()) {
    throw bad_input("network.ports." + options.name + " is missing; give the port of this channel");
  }
  auto link = std::make_unique<ChannelConnections>();
  link->endpoint = {options_.address, port->second};
  link->channel = std::make_unique<TcpChannel>(runtime_, observer_, options, [this] {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
  });
  check_address(link->endpoint);
  if (options_.listens) link->listener = listen_on(link->endpoint);
  links_.push_back(std::move(link));
  return *links_.back()->channel;
}

std::uint16_t TcpNetwork::port(const std::string& channel) const {
  for (const auto& link : links_) {
    if (link->channel->options().name == channel) return local_port(link->listener.get());
  }
  return 0;
}

PeerState TcpNetwork::peer() const {
  std::lock_guard lock(mutex_);
  return peer_;
}

void TcpNetwork::start() {
  thread_ = std::thread([this] {
    pthread_setname_np(pthread_self(), "link-io");
    run();
  });
}

bool TcpNetwork::wait_connected(Duration timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  std::unique_lock lock(mutex_);
  while (!peer_.connected) {
    if (runtime_.stopping() || std::chrono::steady_clock::now() >= deadline) return false;
    changed_.wait_until(lock, std::min(deadline, std::chrono::steady_clock::now() + kLookEvery));
  }
  return true;
}

void TcpNetwork::close(Duration linger) {
  if (!thread_.joinable()) return;
  {
    std::lock_guard lock(mutex_);
    close_by_ = monotonic_now() + linger;
  }
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(wake_.get(), &one, sizeof one);
  thread_.join();
}

void TcpNetwork::run() {
  for (;;) {
    RunTime close_by{};
    {
      std::lock_guard lock(mutex_);
      close_by = close_by_;
    }
    if (close_by != kNever) {
      for (auto& link : links_) {
        if (link->current) link->current->begin_close();
      }
      if (monotonic_now() >= close_by || flushed()) break;
    }
    PollSet polled;
    polled.add(wake_.get(), POLLIN);
    for (auto& link : links_) {
      if (link->listener) polled.add(link->listener.get(), POLLIN);
      if (link->connecting) polled.add(link->connecting.get(), POLLOUT);
      for (auto& connection : link->connections) {
        polled.add(connection->fd(),
                   static_cast<short>(POLLIN | (connection->wants_write() ? POLLOUT : 0)));
      }
    }
    const Duration patience = close_by == kNever ? kLookEvery : kLookEveryClosing;
    ::poll(
        polled.fds.data(), polled.fds.size(),
        static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(patience).count()));
    std::uint64_t ignored = 0;
    [[maybe_unused]] const auto drained = ::read(wake_.get(), &ignored, sizeof ignored);
    for (auto& link : links_) serve(*link, polled);
    for (auto& link : links_) {
      keep_alive(*link);
      watch_stall(*link);
    }
  }
  for (auto& link : links_) {
    link->channel->set_connection(-1);
    link->connections.clear();
    link->current = nullptr;
    link->listener.reset();
    link->connecting.reset();
  }
}

void TcpNetwork::keep_alive(ChannelConnections& link) {
  if (!link.channel->options().heartbeat) return;
  const bool was_silent = silent_;
  silent_ = false;
  if (link.current) {
    const RunTime now = monotonic_now();
    if (now - link.current->last_sent() >= options_.heartbeat) {
      const auto clock = [this] { return runtime_.now(); };
      link.current->send_heartbeat(clock);
    }
    silent_ = now - link.current->last_received() > options_.silence;
    if (silent_ && !was_silent) {
      const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(options_.silence);
      link.channel->record_link("silent",
                                "nothing received for " + std::to_string(ms.count()) + " ms");
    }
    if (!silent_ && was_silent) link.channel->record_link("alive", "");
  }
  if (silent_ != was_silent) announce();
}

void TcpNetwork::watch_stall(ChannelConnections& link) {
  const RunTime now = monotonic_now();
  const std::uint64_t acknowledged = link.current ? link.current->acknowledged() : 0;
  const bool waits = link.current && unacknowledged_bytes(link.current->fd()) > 0;
  if (!waits || acknowledged != link.acknowledged) {
    link.acknowledged = acknowledged;
    if (const auto lasted = link.stall.progress(now))
      link.channel->record_link("flowing", StallWatch::end_detail(*lasted));
  } else if (link.stall.stalls(now)) {
    link.channel->record_link("stalled", StallWatch::begin_detail());
  }
}

bool TcpNetwork::flushed() const {
  for (const auto& link : links_) {
    if (!link->current) continue;  // no peer to send to
    if (!link->channel->idle() || !link->current->close_sent() || link->current->sending() ||
        unacknowledged_bytes(link->current->fd()) > 0) {
      return false;
    }
  }
  return true;
}

void TcpNetwork::announce() {
  const bool connected =
      !silent_ && std::all_of(links_.begin(), links_.end(),
                              [](const auto& link) { return link->current != nullptr; });
  {
    std::lock_guard lock(mutex_);
    peer_.connected = connected;
  }
  changed_.notify_all();
  peer_signal_->notify();
}

}  // namespace slambed
