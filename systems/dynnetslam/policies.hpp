// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>

#include "dynnetslam/edge_contact.hpp"
#include "dynnetslam/strategy.hpp"
#include "node/local_mapping.hpp"
#include "offload/handover_server.hpp"
#include "offload/sides.hpp"

namespace slambed::dynnetslam {

/// Edge-SLAM's mobile node with a mapper of its own, and the decision where mapping runs.
class DynNetSlamMobile final : public MobilePolicy {
 public:
  DynNetSlamMobile(MobileNode& node, const Parameters& parameters);

  void start() override;
  void before_frame(Worker& worker, const OfferedFrame& frame) override;
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish(Worker& worker) override;
  void place_keyframes(PoseBook& book) override;
  MapCounts counts() const override;

 private:
  /// A keyframe that waits for the edge to take the map over.
  struct HeldKeyFrame {
    TrackedFrame frame;
    MapDelta made;
    KeyFrameNeed need;
  };

  bool maps_here() const { return state_ != State::kOffloading || contact_.handing_over(); }
  void decide(Worker& worker);
  void enter(Worker& worker, State next, std::optional<Duration> rtt);
  void make_keyframe(Worker& worker, const TrackedFrame& frame);
  void send(Worker& worker, const TrackedFrame& frame, MapDelta made, KeyFrameNeed need);
  void settle_handover(Worker& worker);
  /// Sends the oldest held keyframe once the one before has left: the queues on the way hold two.
  void send_held(Worker& worker);
  void begin_epoch();

  MobileNode& node_;
  Thresholds thresholds_;
  Duration decision_gap_;
  OffloadMobile offload_;
  EdgeContact contact_;
  LocalMapping mapping_;

  // The tracking worker's.
  State state_ = State::kOffloading;
  bool decided_ = false;  ///< the first decision was made
  std::uint64_t epoch_ = 0;
  RunTime last_decision_{};
  std::deque<HeldKeyFrame> held_;
  bool edge_has_the_map_ = false;  ///< at the end of the run, all of it
};

/// Edge-SLAM's edge node that rests and takes maps over when it is told to.
class DynNetSlamEdge final : public EdgePolicy {
 public:
  DynNetSlamEdge(EdgeNode& node, const Parameters& parameters);

  void start() override;
  std::shared_ptr<const Map> map() const override { return offload_.map(); }

 private:
  OffloadEdge offload_;
  HandoverServer handover_;
};

}  // namespace slambed::dynnetslam
