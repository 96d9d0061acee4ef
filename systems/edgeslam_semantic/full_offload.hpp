// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "edgeslam_semantic/remote_tracking.hpp"
#include "edgeslam_semantic/tracking_service.hpp"

namespace slambed::edgeslam_semantic {

/// The mobile of fully offloaded ORB-SLAM and Mask-SLAM: sends pictures and waits for poses.
class OffloadedMobile final : public MobilePolicy {
 public:
  OffloadedMobile(MobileNode& node, const Parameters& parameters);

  void start() override;
  bool offload(Worker& worker, const OfferedFrame& frame) override;
  void after_frame(Worker&, const TrackedFrame&) override {}
  void finish(Worker& worker) override;
  void place_keyframes(PoseBook& book) override;
  MapCounts counts() const override { return shutdown_.counts(); }

 private:
  MobileNode& node_;
  Channel &control_, &frames_;
  RemoteTracking tracking_;
  MobileShutdown shutdown_;
};

class OffloadedEdge final : public EdgePolicy {
 public:
  OffloadedEdge(EdgeNode& node, const Parameters& parameters, const TrackerOptions& tracker);

  void start() override;
  std::shared_ptr<const Map> map() const override { return service_.map(); }

 private:
  Channel &control_, &frames_;
  TrackingService service_;
  EdgeShutdown shutdown_;
};

}  // namespace slambed::edgeslam_semantic
