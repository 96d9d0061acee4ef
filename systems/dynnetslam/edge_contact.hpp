// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>

#include "dynnetslam/handover_client.hpp"
#include "dynnetslam/link_estimator.hpp"
#include "node/messaging.hpp"

namespace slambed {

struct ContactOptions {
  LinkOptions link;
  double echo_hz;  ///< STATE messages per second while nothing changes
};

/// Reads the parameters rtt_source, rtt_missing_s, mes_probe_hz, mes_probe_bytes and echo_hz.
ContactOptions contact_options(const Parameters& parameters);

/// The mobile's side of the channel "handover": tells the edge where mapping runs, measures the RTT
/// while no keyframes are sent, notices an edge that does not answer or has no map, and hands the
/// map over. One worker does all of this, so that tracking never waits; tracking calls the
/// functions below.
class EdgeContact {
 public:
  EdgeContact(MobileNode& node, Channel& handover, Channel& keyframe,
              const ContactOptions& options);

  void start();
  /// Returns the RTT to decide with, or nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const { return link_.rtt(now); }

  /// Tells the edge where mapping runs now. probed: without keyframes, probes measure the RTT.
  void announce(const wire::StateMessage& state, bool probed);
  /// Stops mapping on the edge.
  void stop(std::uint64_t epoch) { handover_.stop(epoch); }
  /// Sends the edge what it lacks of this map, and lets it map again.
  void hand_over(std::uint64_t epoch, std::shared_ptr<Map> map);
  /// A keyframe was sent to the edge; the RTT is measured with it.
  void keyframe_sent(RunTime now);
  /// True from hand_over() until the edge has accepted the map.
  bool handing_over() const { return handover_.under_way(); }
  /// Returns whether the edge should have a map but reports none: it was restarted, or never
  /// received the first keyframe.
  bool edge_is_empty() const { return edge_is_empty_; }
  /// The edge has sent this map.
  void received(std::shared_ptr<const Map> map) { handover_.received(std::move(map)); }

 private:
  void work(Worker& worker);
  void on_echo(std::uint64_t sequence, RunTime received);
  void on_ack(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now);
  void send_state(RunTime now, bool changed);
  RunTime probe(RunTime now);

  MobileNode& node_;
  Channel& channel_;
  LinkEstimator link_;
  HandoverClient handover_;
  Inbox inbox_;
  Duration echo_period_;
  std::atomic<bool> edge_is_empty_{false};
  std::atomic<bool> changed_{false};  ///< a new state must be sent
  std::atomic<Duration> first_keyframe_{kNever}, last_keyframe_{Duration::zero()};

  std::mutex mutex_;  ///< guards what follows; keeps edge_is_empty_ false during a hand-over
  wire::StateMessage state_;
  bool probing_ = false;
};

}  // namespace slambed
