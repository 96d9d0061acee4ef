// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "runtime/live/tcp_channel.hpp"
#include "runtime/live/tcp_connection.hpp"
#include "runtime/network.hpp"

namespace slambed {

struct TcpNetworkOptions {
  bool listens = false;  ///< the edge listens, the mobile connects (and reconnects)
  std::string address;   ///< of the edge, on both sides
  std::map<std::string, std::uint16_t> ports;  ///< by channel; 0 lets the kernel choose (tests)
  std::string congestion_control = "cubic";    ///< the same on every host
  Duration retry = std::chrono::milliseconds(100);    ///< between two attempts to connect
  Duration attempt = std::chrono::seconds(1);         ///< a connect that takes longer starts again
  Duration greeting_limit = std::chrono::seconds(5);  ///< for a stranger who says nothing
  Duration heartbeat = std::chrono::milliseconds(250);
  Duration silence = kPeerSilence;  ///< then the peer counts as away
};

/// One TCP connection per channel and one I/O thread for all of them.
class TcpNetwork final : public Network {
 public:
  TcpNetwork(LiveRuntime& runtime, Observer& observer, TcpNetworkOptions options,
             Greeting greeting);
  ~TcpNetwork() override;

  /// Listening: binds at once, environment_error when the port is taken. bad_input: unknown
  /// channel.
  Channel& open(const ChannelOptions& options) override;
  PeerState peer() const override;
  Signal& peer_signal() override { return *peer_signal_; }
  /// Starts the I/O thread; all channels are open by then.
  void start();
  /// True when every channel has a greeted peer. Ends early when the runtime stops.
  bool wait_connected(Duration timeout);
  /// Sends what is queued, for at most linger, then closes everything.
  void close(Duration linger);
  std::uint16_t port(const std::string& channel) const;

 private:
  struct Link;
  struct PollSet;

  void run();
  void serve(Link& link, PollSet& polled);
  void connect(Link& link);
  void accept(Link& link);
  void adopt(Link& link, FileDescriptor fd);
  void pump(Link& link, TcpConnection& connection, short events);
  void promote(Link& link, TcpConnection& fresh);
  void end(Link& link, const TcpConnection& ended, const TcpConnection::End& why);
  void end_current(Link& link, const std::string& reason);
  void note_session(Link& link, std::uint64_t session_id);
  void keep_alive(Link& link);
  void watch_stall(Link& link);
  bool flushed() const;
  void announce();

  LiveRuntime& runtime_;
  Observer& observer_;
  TcpNetworkOptions options_;
  Greeting greeting_;
  std::uint64_t session_id_;  ///< tells a restarted process from a reconnecting one
  std::uint64_t peer_session_id_ = 0;
  bool silent_ = false;  ///< connected, but nothing comes
  FileDescriptor wake_;
  std::vector<std::unique_ptr<Link>> links_;
  std::unique_ptr<Signal> peer_signal_;
  mutable std::mutex mutex_;  ///< guards peer_ and close_by_
  std::condition_variable changed_;
  PeerState peer_;
  RunTime close_by_ = kNever;  ///< monotonic time
  std::thread thread_;
};

}  // namespace slambed
