// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/nodes/offload_edge.hpp"
#include "offload/nodes/offload_mobile.hpp"

namespace slambed {

/// Edge-SLAM's decisions on the mobile node: when to make a keyframe, and what to send to an edge
/// that is new or has no map.
class EdgeSlamMobile final : public MobilePolicy {
 public:
  EdgeSlamMobile(MobileNode& node, const Parameters& parameters,
                 const OffloadMobileParts& parts = {});

  void start() override { offload_.start(); }
  void before_frame(Worker& worker, const OfferedFrame& frame) override;
  std::shared_ptr<const FeatureSet> before_tracking(
      Worker& worker, const OfferedFrame& frame,
      std::shared_ptr<const FeatureSet> features) override {
    offload_.before_tracking(worker, frame, features);
    return features;
  }
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  std::string_view relocalized_by(const TrackedFrame& frame) override {
    return offload_.relocalized_by(frame);
  }
  void finish(Worker& worker) override { offload_.shut_down(worker); }
  void place_keyframes(PoseBook& book) override;
  MapCounts counts() const override { return offload_.shutdown().counts(); }

 private:
  MobileNode& node_;
  OffloadMobile offload_;
  std::uint64_t edge_session_ =
      0;  ///< of the edge whose map starts with our keyframe, or in whose map we started
  bool edge_has_map_ = true;      ///< false: it reported that it has none, and has sent none since
  bool keyframe_wanted_ = false;  ///< the edge wants one at the next frame
};

class EdgeSlamEdge final : public EdgePolicy {
 public:
  EdgeSlamEdge(EdgeNode& node, const Parameters& parameters, const OffloadEdgeParts& parts = {})
      : offload_(node, parameters, parts) {
    offload_.mapping().ask_when_empty();
  }

  void start() override { offload_.start(); }
  std::shared_ptr<const Map> map() const override { return offload_.map(); }

 private:
  OffloadEdge offload_;
};

}  // namespace slambed
