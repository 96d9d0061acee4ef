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
  Duration missing;  ///< nothing received for so long: there is no RTT
  double probe_hz;   ///< 0: no probes
  int probe_bytes;
};

/// The RTT that a mobile node decides with: as the transport measures it, from the answers to
/// messages of its own, or as the link's profile asks for it. rtt() may be called by any worker,
/// all else by the one that talks to the edge.
class LinkEstimator {
 public:
  /// measured: the channel whose transport is asked, and probed while it carries nothing.
  /// Throws Error(kBadInput) where the profile is to tell and the run has none.
  LinkEstimator(MobileNode& node, Channel& measured, LinkOptions options);

  /// Nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const;
  Duration missing() const { return options_.missing; }

  /// A message that the edge answers at once has left on some channel.
  void asked(std::uint64_t sequence, RunTime sent);
  /// Something came from the edge.
  void received(RunTime now) { last_received_ = now; }
  /// Its answer. Time since asked(); nothing where that was given up or answered before.
  std::optional<Duration> answered(std::uint64_t sequence, RunTime received);
  /// A sample that waited behind nothing: it counts an eighth (RFC 6298, as in the kernel).
  void count(Duration sample);

  /// Sends a probe when it is time to, and says when that will be again (kNever: not by itself).
  RunTime probe(RunTime now);

 private:
  MobileNode& node_;
  Channel& measured_;
  LinkOptions options_;
  std::atomic<Duration> last_received_{Duration::zero()};  ///< run time of the last answer
  std::atomic<Duration> echo_{Duration::min()};            ///< smoothed; min: none yet
  std::deque<std::pair<std::uint64_t, RunTime>> asked_;    ///< sequence and time, not yet answered
  RunTime next_probe_{};
};

}  // namespace slambed
