// SPDX-License-Identifier: Apache-2.0
// Opening, greeting, replacing and ending the connections of a channel.
#include "runtime/live/tcp_channel_connections.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>

namespace slambed {
namespace {

/// Limit of simultaneous connections whose greeting has not been accepted yet.
constexpr std::size_t kMaxCandidates = 8;

}  // namespace

void TcpNetwork::serve(ChannelConnections& link, PollSet& polled) {
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

void TcpNetwork::accept(ChannelConnections& link) {
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

void TcpNetwork::connect(ChannelConnections& link) {
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

void TcpNetwork::adopt(ChannelConnections& link, FileDescriptor fd) {
  link.untuned = tune_connection(fd.get(), options_.congestion_control);
  const auto& options = link.channel->options();
  link.connections.push_back(
      std::make_unique<TcpConnection>(std::move(fd), options.max_payload, monotonic_now()));
  link.connections.back()->greet(session_id_, greeting_.own(options.name));
}

void TcpNetwork::pump(ChannelConnections& link, TcpConnection& connection, short events) {
  const auto clock = [this] { return runtime_.now(); };
  std::optional<TcpConnection::End> ended;
  bool newly_greeted = false;
  if (events & (POLLIN | POLLHUP | POLLERR)) {
    std::uint64_t session_id = 0;
    ended = connection.read_some(
        [&](const FrameHeader& header, Bytes payload) -> std::optional<std::string> {
          session_id = header.sequence;
          auto refused = greeting_.check(link.channel->options().name, payload);
          if (refused) return refused;
          note_session(link, session_id);
          newly_greeted = true;
          return std::nullopt;
        },
        [&](const FrameHeader& header, Bytes payload) -> std::optional<std::string> {
          link.channel->deliver({.type = header.type,
                                 .sequence = header.sequence,
                                 .queued = header.queued,
                                 .sent = header.sent,
                                 .received = runtime_.now(),
                                 .session = link.session,
                                 .payload = std::move(payload)});
          return std::nullopt;
        });
  }
  if (!ended && !connection.greeted() &&
      monotonic_now() - connection.opened() > options_.greeting_limit) {
    ended = TcpConnection::End{true, "no greeting in time"};
  }
  // Before writing, so that an unfinished message of the previous connection is sent first.
  if (newly_greeted && !ended) promote(link, connection);
  if (!ended) {
    ended = connection.write_some(clock, [&] { return link.channel->next_to_send(); });
  }
  if (ended) end(link, connection, *ended);
}

void TcpNetwork::promote(ChannelConnections& link, TcpConnection& fresh) {
  if (link.current != &fresh) {  // the peer may be back before we noticed its loss
    end_current(link, "replaced by a new connection");
  }
  link.current = &fresh;
  for (auto& other : links_) {  // end the connections of the peer's previous process
    if (other->peer_session_id != peer_session_id_) end_current(*other, "the peer was restarted");
  }
  link.channel->set_connection(fresh.fd());
  std::string detail = link.endpoint.address + " port " + std::to_string(link.endpoint.port);
  if (link.session > 1) detail += ", session " + std::to_string(link.session);
  if (!link.untuned.empty()) detail += ", could not set " + link.untuned;
  link.channel->record_link(link.ever_connected ? "reconnected" : "connected", detail);
  link.ever_connected = true;
  announce();
}

void TcpNetwork::end(ChannelConnections& link, const TcpConnection& ended,
                     const TcpConnection::End& why) {
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
    if (!connection->peer_closing()) {
      const auto bytes = unacknowledged_bytes(connection->fd());
      link.channel->record_link(
          "lost", why.reason + ", " + std::to_string(bytes) + " bytes unacknowledged");
    }
    announce();
  }
  link.next_attempt = monotonic_now() + options_.retry;
}

void TcpNetwork::end_current(ChannelConnections& link, const std::string& reason) {
  if (link.current) end(link, *link.current, {false, reason});
}

/// Called for an accepted greeting. The id distinguishes a restarted peer from a reconnecting one.
void TcpNetwork::note_session(ChannelConnections& link, std::uint64_t session_id) {
  std::lock_guard lock(mutex_);
  if (session_id != peer_session_id_) {
    peer_session_id_ = session_id;
    ++peer_.session;
  }
  if (session_id != link.peer_session_id) link.channel->forget_peer_sequence();
  link.peer_session_id = session_id;
  link.session = peer_.session;
}

}  // namespace slambed
