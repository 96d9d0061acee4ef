// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/edge_mapping.hpp"
#include "offload/farewell.hpp"
#include "offload/keyframe_uplink.hpp"
#include "offload/map_downlink.hpp"
#include "offload/relocalisation.hpp"

namespace slambed {

/// The channels of Edge-SLAM, with its drop-oldest queues on both sides.
struct EdgeSlamChannels {
  EdgeSlamChannels(Network& network, int keyframe_queue);
  Channel &control, &keyframe, &map, &frame;
};

class EdgeSlamMobile final : public MobilePolicy {
 public:
  EdgeSlamMobile(MobileNode& node, const Parameters& parameters);

  void start() override;
  void before_frame(Worker& worker, const OfferedFrame& frame) override;
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish(Worker& worker) override;
  void place_keyframes(PoseBook& book) override;
  MapCounts counts() const override { return farewell_.counts(); }

 private:
  MobileNode& node_;
  EdgeSlamChannels channels_;
  KeyFrameUplink uplink_;
  MapDownlink downlink_;
  RelocalisationRequests relocalisation_;
  MobileFarewell farewell_;
  double relocalised_s_ = -1;  ///< sequence time of the last relocalisation; negative: none
  std::uint64_t edge_incarnation_ = 0;  ///< of the edge whose map began with one of our keyframes
};

class EdgeSlamEdge final : public EdgePolicy {
 public:
  EdgeSlamEdge(EdgeNode& node, const Parameters& parameters);

  void start() override;
  MapCounts counts() const override { return count(*mapping_.map()); }

 private:
  EdgeSlamChannels channels_;
  EdgeMapping mapping_;
  RelocalisationService relocalisation_;
  EdgeFarewell farewell_;
};

}  // namespace slambed
