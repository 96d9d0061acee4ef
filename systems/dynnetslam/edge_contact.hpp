// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>

#include "dynnetslam/strategy.hpp"
#include "node/mobile_node.hpp"
#include "wire/handover_messages.hpp"

namespace slambed::dynnetslam {

enum class RttSource { kTcpInfo, kEcho, kProfile };

struct ContactOptions {
  RttSource source = RttSource::kTcpInfo;
  double probe_hz = 10;
  int probe_bytes = 64;
  double echo_hz = 4;
  Duration missing = std::chrono::seconds(2);  ///< nothing heard for so long: there is no RTT
};

/// The mobile's side of everything DynNetSLAM adds to Edge-SLAM's messages: says where mapping runs,
/// keeps the RTT measured while no keyframes flow, notices that the edge does not answer, and hands
/// the map over. All of that on one worker, so that tracking never waits; the calls below are
/// tracking's.
class EdgeContact {
 public:
  EdgeContact(MobileNode& node, Channel& handover, Channel& keyframe, ContactOptions options);

  void start();
  /// RTT to decide with; nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const;

  /// The state is another one now.
  void tell(State state, std::uint64_t epoch, std::optional<Duration> rtt);
  /// Mapping on the edge ends, a hand-over under way is worth nothing any more.
  void stop(std::uint64_t epoch);
  /// The edge gets what this map has that it does not know of, and maps again.
  void hand_over(std::uint64_t epoch, std::shared_ptr<Map> map);
  /// A keyframe goes to the edge: the RTT is measured with it.
  void keyframe_sent(RunTime now);
  /// True from hand_over() until the edge has taken the map over.
  bool handing_over() const { return handing_over_; }
  /// The edge maps and should have a map, but says that it has none: it was started again, or never
  /// got the first keyframe.
  bool edge_is_empty() const { return edge_is_empty_; }
  /// The edge has sent this map.
  void received(std::shared_ptr<const Map> map);

 private:
  /// What an edge knows of a map: that map as it was then.
  struct Known {
    std::shared_ptr<const Map> map;
    std::shared_ptr<const MapDelta> content;
    std::uint64_t edge = 0;  ///< incarnation of the edge that knows
  };
  struct Handover {
    std::uint64_t epoch = 0, number = 0;
    Known known;  ///< once it is acknowledged
    RunTime asked{};
    bool under_way = false;   ///< sent, not answered
    bool superseded = false;  ///< the edge has sent another map since
    std::uint64_t connection = 0;  ///< on which it was sent last
    std::uint8_t type = 0;
    Bytes payload;  ///< as it was sent: a broken connection may have lost it
  };

  void work(Worker& worker);
  void take(const Message& message, RunTime now);
  void take_echo(std::uint64_t sequence, RunTime received);
  void take_ack(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now);
  void say_state(RunTime now, bool changed);
  RunTime probe_if_due(RunTime now);
  void hand_over_if_due(Worker& worker);
  void prepare_handover(Worker& worker, Handover handover, Known known);
  void send_handover(Handover& handover);

  MobileNode& node_;
  Channel& channel_;
  Channel& keyframe_channel_;
  ContactOptions options_;
  std::atomic<bool> handing_over_{false};
  std::atomic<bool> edge_is_empty_{false};
  std::atomic<bool> news_{false};  ///< another state is to be told
  std::atomic<Duration> heard_{Duration::zero()};  ///< run time of the last answer
  std::atomic<Duration> echo_{Duration::min()};    ///< smoothed; min: none yet
  std::atomic<Duration> first_keyframe_{kNever}, last_keyframe_{Duration::zero()};

  // The worker's.
  RunTime next_probe_{};
  std::deque<std::pair<std::uint64_t, RunTime>> echoes_;  ///< sequence and time of STATEs

  std::mutex mutex_;  ///< guards what follows
  wire::StateMessage state_;
  bool probing_ = false;
  Known known_;
  std::shared_ptr<Map> map_;  ///< to be handed over
  Handover handover_;
  std::uint64_t handovers_ = 0;
};

}  // namespace slambed::dynnetslam
