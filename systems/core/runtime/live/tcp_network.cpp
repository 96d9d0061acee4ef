// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/tcp_network.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/error.hpp"

namespace slambed {
namespace {

/// Strangers that may wait for their greeting's check at once.
constexpr std::size_t kMaxCandidates = 8;
/// A flood of garbage must not fill the disk through the event log.
constexpr int kMaxRejectionsRecorded = 100;
constexpr Duration kLookEvery = std::chrono::milliseconds(100);
constexpr Duration kLookEveryClosing = std::chrono::milliseconds(5);

}  // namespace

/// One channel with its sockets. Connections other than the current one have not been greeted yet.
struct TcpNetwork::Link {
  std::unique_ptr<TcpChannel> channel;
  Endpoint endpoint;
  FileDescriptor listener;
  FileDescriptor connecting;
  RunTime next_attempt{};  ///< monotonic
  RunTime attempt_until{};
  std::vector<std::unique_ptr<TcpConnection>> connections;
  TcpConnection* current = nullptr;
  bool ever_connected = false;
  std::uint64_t peer_session = 0;
  std::uint64_t incarnation = 0;
  int rejections = 0;
  std::string untuned;  ///< socket options that the host refused

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

TcpNetwork::TcpNetwork(LiveRuntime& runtime, Observer& observer, TcpNetworkOptions options,
                       Greeting greeting)
    : runtime_(runtime),
      observer_(observer),
      options_(std::move(options)),
      greeting_(std::move(greeting)),
      session_(static_cast<std::uint64_t>(monotonic_now().count()) ^
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
  auto link = std::make_unique<Link>();
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
        if (link->current) link->current->part();
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
    for (auto& link : links_) keep_alive(*link);
  }
  for (auto& link : links_) {
    link->channel->set_connection(-1);
    link->connections.clear();
    link->current = nullptr;
    link->listener.reset();
    link->connecting.reset();
  }
}

void TcpNetwork::serve(Link& link, PollSet& polled) {
  if (options_.listens) {
    if (polled.result(link.listener.get()) & POLLIN) accept(link);
  } else {
    connect(link);
  }
  for (std::size_t i = 0; i < link.connections.size();) {
    const auto before = link.connections[i].get();
    pump(link, *before, polled.result(before->fd()));
    if (i < link.connections.size() && link.connections[i].get() == before) ++i;
  }
}

void TcpNetwork::accept(Link& link) {
  for (;;) {
    FileDescriptor fd(
        ::accept4(link.listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!fd) return;
    const std::size_t candidates = link.connections.size() - (link.current ? 1 : 0);
    if (candidates >= kMaxCandidates) {
      link.reject("too many connections without a greeting");
      continue;
    }
    adopt(link, std::move(fd));
  }
}

void TcpNetwork::connect(Link& link) {
  const RunTime now = monotonic_now();
  if (!link.connections.empty()) return;
  if (link.connecting) {
    pollfd entry{link.connecting.get(), POLLOUT, 0};
    const bool decided = ::poll(&entry, 1, 0) > 0;
    if (decided && connect_error(link.connecting.get()) == 0) {
      adopt(link, std::move(link.connecting));
      return;
    }
    if (decided || now >= link.attempt_until) {
      link.connecting.reset();
      link.next_attempt = now + options_.retry;
    }
    return;
  }
  if (now < link.next_attempt) return;
  link.connecting = begin_connect(link.endpoint);
  link.attempt_until = now + options_.attempt;
  if (!link.connecting) link.next_attempt = now + options_.retry;
}

void TcpNetwork::adopt(Link& link, FileDescriptor fd) {
  link.untuned = tune_connection(fd.get(), options_.congestion_control);
  const auto& options = link.channel->options();
  link.connections.push_back(
      std::make_unique<TcpConnection>(std::move(fd), options.max_payload, monotonic_now()));
  link.connections.back()->greet(session_, greeting_.own(options.name));
}

void TcpNetwork::pump(Link& link, TcpConnection& connection, short events) {
  const auto clock = [this] { return runtime_.now(); };
  std::optional<TcpConnection::End> ended;
  bool newly_greeted = false;
  if (events & (POLLIN | POLLHUP | POLLERR)) {
    std::uint64_t session = 0;
    ended = connection.read_some(
        [&](const FrameHeader& header, Bytes payload) -> std::optional<std::string> {
          session = header.sequence;
          auto refused = greeting_.check(link.channel->options().name, payload);
          if (refused) return refused;
          meet(link, session);
          newly_greeted = true;
          return std::nullopt;
        },
        [&](const FrameHeader& header, Bytes payload) -> std::optional<std::string> {
          link.channel->deliver({.type = header.type,
                                 .sequence = header.sequence,
                                 .queued = header.queued,
                                 .sent = header.sent,
                                 .received = runtime_.now(),
                                 .incarnation = link.incarnation,
                                 .payload = std::move(payload)});
          return std::nullopt;
        });
  }
  if (!ended && !connection.greeted() &&
      monotonic_now() - connection.opened() > options_.greeting_limit) {
    ended = TcpConnection::End{true, "no greeting in time"};
  }
  // First, so that what the connection before it did not take whole is the first to go.
  if (newly_greeted && !ended) promote(link, connection);
  if (!ended) {
    ended = connection.write_some(clock, [&] { return link.channel->next_to_send(); });
  }
  if (ended) end(link, connection, *ended);
}

void TcpNetwork::promote(Link& link, TcpConnection& fresh) {
  if (link.current != &fresh) {  // the peer is back before we saw it go
    end_current(link, "replaced by a new connection");
  }
  link.current = &fresh;
  for (auto& other : links_) {  // what is left of a process that is no more
    if (other->peer_session != peer_session_) end_current(*other, "the peer was restarted");
  }
  link.channel->set_connection(fresh.fd());
  std::string detail = link.endpoint.address + " port " + std::to_string(link.endpoint.port);
  if (link.incarnation > 1) detail += ", incarnation " + std::to_string(link.incarnation);
  if (!link.untuned.empty()) detail += ", could not set " + link.untuned;
  link.channel->record_link(link.ever_connected ? "reconnected" : "connected", detail);
  link.ever_connected = true;
  announce();
}

void TcpNetwork::end(Link& link, const TcpConnection& ended, const TcpConnection::End& why) {
  const auto at = std::find_if(link.connections.begin(), link.connections.end(),
                               [&](const auto& c) { return c.get() == &ended; });
  const auto connection = std::move(*at);
  link.connections.erase(at);
  if (why.rejected) link.reject(why.reason);
  if (connection.get() == link.current) {
    link.current = nullptr;
    link.channel->set_connection(-1);
    if (auto unfinished = connection->take_unfinished()) {
      link.channel->put_back(std::move(*unfinished));
    }
    if (!connection->peer_parted()) {
      const auto bytes = unacknowledged_bytes(connection->fd());
      link.channel->record_link(
          "lost", why.reason + ", " + std::to_string(bytes) + " bytes unacknowledged");
    }
    announce();
  }
  link.next_attempt = monotonic_now() + options_.retry;
}

void TcpNetwork::end_current(Link& link, const std::string& reason) {
  if (link.current) end(link, *link.current, {false, reason});
}

/// A greeting was accepted: by it a restarted peer is told from one that reconnects.
void TcpNetwork::meet(Link& link, std::uint64_t session) {
  std::lock_guard lock(mutex_);
  if (session != peer_session_) {
    peer_session_ = session;
    ++peer_.incarnation;
  }
  if (session != link.peer_session) link.channel->forget_peer_sequence();
  link.peer_session = session;
  link.incarnation = peer_.incarnation;
}

void TcpNetwork::keep_alive(Link& link) {
  if (!link.channel->options().heartbeat) return;
  const bool was_silent = silent_;
  silent_ = false;
  if (link.current) {
    const RunTime now = monotonic_now();
    if (now - link.current->spoke() >= options_.heartbeat) {
      const auto clock = [this] { return runtime_.now(); };
      link.current->show_life(clock);
    }
    silent_ = now - link.current->heard() > options_.silence;
    if (silent_ && !was_silent) {
      const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(options_.silence);
      link.channel->record_link("silent",
                                "no sign of life for " + std::to_string(ms.count()) + " ms");
    }
    if (!silent_ && was_silent) link.channel->record_link("heard", "");
  }
  if (silent_ != was_silent) announce();
}

bool TcpNetwork::flushed() const {
  for (const auto& link : links_) {
    if (!link->current) continue;  // nobody to send it to
    if (!link->channel->idle() || !link->current->parted() || link->current->sending() ||
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
