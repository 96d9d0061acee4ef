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
  double echo_hz;  ///< STATEs a second while nothing changes
};

/// Of the parameters rtt_source, rtt_missing_s, mes_probe_hz, mes_probe_bytes and echo_hz.
ContactOptions contact_options(const Parameters& parameters);

/// The mobile's talk with the edge on the channel "handover": tells the edge where mapping runs,
/// keeps the RTT measured while no keyframes flow, notices that the edge does not answer or has no
/// map, and lets the map go over. All of that on one worker, so that tracking never waits; the
/// calls below are tracking's.
class EdgeContact {
 public:
  EdgeContact(MobileNode& node, Channel& handover, Channel& keyframe,
              const ContactOptions& options);

  void start();
  /// RTT to decide with; nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const { return link_.rtt(now); }

  /// Mapping runs elsewhere now: the edge is told; probed: no keyframes will flow, so the RTT is
  /// measured without them.
  void announce(const wire::StateMessage& state, bool probed);
  /// Mapping on the edge ends.
  void stop(std::uint64_t epoch) { handover_.stop(epoch); }
  /// The edge gets what this map has that it does not know of, and maps again.
  void hand_over(std::uint64_t epoch, std::shared_ptr<Map> map);
  /// A keyframe goes to the edge: the RTT is measured with it.
  void keyframe_sent(RunTime now);
  /// True from hand_over() until the edge has taken the map over.
  bool handing_over() const { return handover_.under_way(); }
  /// The edge maps and should have a map, but says that it has none: it was started again, or never
  /// got the first keyframe.
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
  std::atomic<bool> changed_{false};  ///< another state is to be told
  std::atomic<Duration> first_keyframe_{kNever}, last_keyframe_{Duration::zero()};

  std::mutex
      mutex_;  ///< guards what follows, and that the edge is empty only while no map goes over
  wire::StateMessage state_;
  bool probing_ = false;
};

}  // namespace slambed
