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
  Duration attempt = std::chrono::seconds(1);         ///< a connect that takes longer is restarted
  Duration greeting_limit = std::chrono::seconds(5);  ///< until the peer's greeting must be here
  Duration heartbeat = std::chrono::milliseconds(250);
  Duration silence = kPeerSilence;  ///< after this the peer counts as disconnected
};

/// One TCP connection per channel and one I/O thread for all of them.
class TcpNetwork final : public Network {
 public:
  TcpNetwork(LiveRuntime& runtime, Observer& observer, TcpNetworkOptions options,
             Greeting greeting);
  ~TcpNetwork() override;

  /// If listening, binds at once. Throws environment_error if the port is taken, bad_input if the
  /// channel has no port.
  Channel& open(const ChannelOptions& options) override;
  PeerState peer() const override;
  Signal& peer_signal() override { return *peer_signal_; }
  /// Starts the I/O thread. All channels must be open.
  void start();
  /// Returns true once every channel has a greeted peer, false at the timeout or when the runtime
  /// stops.
  bool wait_connected(Duration timeout);
  /// Sends queued messages for at most `linger`, then closes everything.
  void close(Duration linger);
  std::uint16_t port(const std::string& channel) const;

 private:
  struct ChannelConnections;
  struct PollSet;

  void run();
  void serve(ChannelConnections& link, PollSet& polled);
  void connect(ChannelConnections& link);
  void accept(ChannelConnections& link);
  void adopt(ChannelConnections& link, FileDescriptor fd);
  void pump(ChannelConnections& link, TcpConnection& connection, short events);
  void promote(ChannelConnections& link, TcpConnection& fresh);
  void end(ChannelConnections& link, const TcpConnection& ended, const TcpConnection::End& why);
  void end_current(ChannelConnections& link, const std::string& reason);
  void note_session(ChannelConnections& link, std::uint64_t session_id);
  void keep_alive(ChannelConnections& link);
  void watch_stall(ChannelConnections& link);
  bool flushed() const;
  void announce();

  LiveRuntime& runtime_;
  Observer& observer_;
  TcpNetworkOptions options_;
  Greeting greeting_;
  std::uint64_t session_id_;  ///< distinguishes a restarted process from a reconnecting one
  std::uint64_t peer_session_id_ = 0;
  bool silent_ = false;  ///< connected, but nothing received for options_.silence
  FileDescriptor wake_;
  std::vector<std::unique_ptr<ChannelConnections>> links_;
  std::unique_ptr<Signal> peer_signal_;
  mutable std::mutex mutex_;  ///< guards peer_ and close_by_
  std::condition_variable changed_;
  PeerState peer_;
  RunTime close_by_ = kNever;  ///< monotonic time
  std::thread thread_;
};

}  // namespace slambed
