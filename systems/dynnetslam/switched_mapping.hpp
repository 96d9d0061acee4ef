// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>

#include "dynnetslam/edge_contact.hpp"
#include "dynnetslam/handover_server.hpp"
#include "node/local_mapping.hpp"
#include "offload/nodes/offload_edge.hpp"
#include "offload/nodes/offload_mobile.hpp"

namespace slambed {

/// Where mapping runs; place_of (mobile_policy.cpp) derives it from the strategy's state. Tracking
/// always runs on the mobile node. STATE carries it as a number.
enum class MappingPlace : std::uint8_t { kEdge, kBoth, kMobile };

/// Edge-SLAM's mobile node with its own mapper: mapping moves between the nodes during the run, and
/// the map with it. The system decides where mapping runs. Call it on the tracking worker.
class SwitchedMapping {
 public:
  SwitchedMapping(MobileNode& node, const Parameters& parameters);

  void start();
  /// Runs between two frames: applies updates and finished hand-overs, and sends the map to an edge
  /// that has lost it.
  void before_frame(Worker& worker);
  /// Call it first after each frame.
  void after_frame(Worker& worker, const TrackedFrame& frame);
  /// Returns the RTT to decide with, or nothing when the edge or the path is silent.
  std::optional<Duration> rtt(RunTime now) const { return contact_.rtt(now); }
  /// Moves mapping there. Returns the epoch of the maps that the edge sends from then on.
  std::uint64_t move_to(MappingPlace place, std::optional<Duration> rtt);
  /// Once the edge has the map, parks the mobile's mapper unless it is still needed, and sends
  /// deferred keyframes.
  void finish_handover(Worker& worker);
  /// Returns whether the last tracked frame should become a keyframe.
  bool wants_keyframe();
  /// Makes a keyframe and passes it to the mappers.
  void make_keyframe(Worker& worker, const TrackedFrame& frame);
  /// Call it when playback is over.
  void finish(Worker& worker);
  void place_keyframes(PoseBook& book) const;
  MapCounts counts() const;

 private:
  /// A keyframe that waits until the edge has accepted the map.
  struct DeferredKeyFrame {
    TrackedFrame frame;
    MapDelta made;
    KeyFrameNeed need = KeyFrameNeed::kNone;
  };

  bool maps_here() const { return place_ != MappingPlace::kEdge || contact_.handing_over(); }
  void begin_epoch();
  void announce(std::optional<Duration> rtt);
  void send(Worker& worker, const TrackedFrame& frame, MapDelta made, KeyFrameNeed need);
  /// Sends the oldest deferred keyframe once the last one has left: the queues hold only two.
  void send_deferred(Worker& worker);

  MobileNode& node_;
  OffloadMobile offload_;
  EdgeContact contact_;
  LocalMapping mapping_;
  MappingPlace place_ = MappingPlace::kEdge;
  std::uint64_t epoch_ = 0;
  std::deque<DeferredKeyFrame> deferred_;
  bool edge_has_the_map_ = false;  ///< the edge has the whole map at the end of the run
};

/// Edge-SLAM's edge node that can pause mapping and take over maps.
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
