// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <optional>
#include <utility>

#include "node/mobile_node.hpp"

namespace slambed {

enum class RttSource { kTcpInfo, kEcho, kProfile };

struct LinkOptions {
  RttSource source;
  Duration missing;  ///< without messages for this long there is no RTT
  double probe_hz;   ///< 0: no probes
  int probe_bytes;
};

/// Estimates the RTT that a mobile node decides with: from the transport, from the answers to its
/// own messages, or from the link's profile. Any worker may call rtt(); only the worker that talks
/// to the edge may call the rest.
class LinkEstimator {
 public:
  /// measured: the channel whose transport reports the RTT, and which is probed while it is idle.
  /// Throws Error(kBadInput) if the profile is the source and the run has none.
  LinkEstimator(MobileNode& node, Channel& measured, LinkOptions options);

  /// Returns nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const;
  Duration missing() const { return options_.missing; }

  /// A message that the edge answers at once was sent on some channel.
  void asked(std::uint64_t sequence, RunTime sent);
  /// A message arrived from the edge.
  void received(RunTime now) { last_received_ = now; }
  /// The answer arrived. Returns the time since asked(); nothing if given up or answered before.
  std::optional<Duration> answered(std::uint64_t sequence, RunTime received);
  /// Adds a sample that waited behind no other data, with weight 1/8 (RFC 6298, as the kernel).
  void count(Duration sample);

  /// Sends a probe if one is due, and returns when the next one is (kNever: probing is off).
  RunTime probe(RunTime now);

 private:
  MobileNode& node_;
  Channel& measured_;
  LinkOptions options_;
  std::atomic<Duration> last_received_{Duration::zero()};  ///< run time of the last message
  std::atomic<Duration> echo_{Duration::min()};            ///< smoothed; min: none yet
  std::deque<std::pair<std::uint64_t, RunTime>> asked_;    ///< sequence and time, not yet answered
  RunTime next_probe_{};
};

}  // namespace slambed
