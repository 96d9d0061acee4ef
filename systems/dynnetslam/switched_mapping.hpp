// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>

#include "dynnetslam/edge_contact.hpp"
#include "dynnetslam/handover_server.hpp"
#include "node/local_mapping.hpp"
#include "offload/nodes/offload_edge.hpp"
#include "offload/nodes/offload_mobile.hpp"

namespace slambed {

/// Where mapping runs, from the strategy's state by place_of (mobile_policy.cpp); tracking always
/// runs on the mobile node. STATE has it as a number.
enum class MappingPlace : std::uint8_t { kEdge, kBoth, kMobile };

/// Edge-SLAM's mobile node with a mapper of its own: mapping moves between the nodes while the run
/// goes on, the map goes along. Where it runs is the system's decision. On the tracking worker.
class SwitchedMapping {
 public:
  SwitchedMapping(MobileNode& node, const Parameters& parameters);

  void start();
  /// Between two frames: updates and hand-overs take effect, an edge that lost its map gets it.
  void before_frame(Worker& worker);
  /// First thing after each frame.
  void after_frame(Worker& worker, const TrackedFrame& frame);
  /// RTT to decide with; nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const { return contact_.rtt(now); }
  /// Mapping runs there from now on; returns the epoch of the maps that the edge sends then.
  std::uint64_t move_to(MappingPlace place, std::optional<Duration> rtt);
  /// What waited for the map to go over, once it has: the mapper here rests, deferred keyframes
  /// leave.
  void finish_handover(Worker& worker);
  /// Whether one should be made of the frame that was tracked last.
  bool wants_keyframe();
  /// Makes it, and gives it to whoever maps.
  void make_keyframe(Worker& worker, const TrackedFrame& frame);
  /// Playback is over.
  void finish(Worker& worker);
  void place_keyframes(PoseBook& book) const;
  MapCounts counts() const;

 private:
  /// A keyframe that waits for the edge to take the map over.
  struct DeferredKeyFrame {
    TrackedFrame frame;
    MapDelta made;
    KeyFrameNeed need = KeyFrameNeed::kNone;
  };

  bool maps_here() const { return place_ != MappingPlace::kEdge || contact_.handing_over(); }
  void begin_epoch();
  void announce(std::optional<Duration> rtt);
  void send(Worker& worker, const TrackedFrame& frame, MapDelta made, KeyFrameNeed need);
  /// Sends the oldest deferred keyframe once the one before has left: the queues on the way hold
  /// two.
  void send_deferred(Worker& worker);

  MobileNode& node_;
  OffloadMobile offload_;
  EdgeContact contact_;
  LocalMapping mapping_;
  MappingPlace place_ = MappingPlace::kEdge;
  std::uint64_t epoch_ = 0;
  std::deque<DeferredKeyFrame> deferred_;
  bool edge_has_the_map_ = false;  ///< at the end of the run, all of it
};

/// Edge-SLAM's edge node that rests and takes maps over when it is told to.
class SwitchedMappingEdge final : public EdgePolicy {
 public:
  SwitchedMappingEdge(EdgeNode& node, const Parameters& parameters);

  void start() override;
  std::shared_ptr<const Map> map() const override { return offload_.map(); }

 private:
  OffloadEdge offload_;
  HandoverServer handover_;
};

}  // namespace slambed
