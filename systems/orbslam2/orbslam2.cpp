// SPDX-License-Identifier: Apache-2.0
#include "orbslam2/orbslam2.hpp"

#include "node/mobile_node.hpp"
#include "node/onboard_mapping.hpp"
#include "node/tracking_options.hpp"
#include "orbslam2/parameters.hpp"

namespace slambed {
namespace {

class OrbSlam2Policy final : public MobilePolicy {
 public:
  OrbSlam2Policy(MobileNode& node, const Parameters& parameters)
      : node_(node),
        lock_(made_lock(node, parameters)),
        mapping_(node.runtime(), node.log(), node.tracker().map(), node.places(),
                 {.mode = parameters.boolean("sequential") ? LocalMapping::Mode::kSequential
                                                           : LocalMapping::Mode::kWorker,
                  .loop_closing = parameters.boolean("loop_closing"),
                  .lock = lock_.get()}) {}

  void start() override { mapping_.start(); }
  std::shared_ptr<const FeatureSet> before_tracking(
      Worker& worker, const OfferedFrame&, std::shared_ptr<const FeatureSet> features) override {
    if (lock_) lock_->acquire(worker, "tracking");
    return features;
  }
  void after_frame(Worker& worker, const TrackedFrame& frame) override {
    const bool resets = frame.outcome.reset_now;  // waits for mapping, which may need the lock
    if (lock_ && resets) lock_->release();
    mapping_.after_frame(worker, node_.tracking(), frame);
    if (lock_ && !resets) lock_->release();
  }
  void finish(Worker& worker) override { mapping_.drain(worker); }
  void place_keyframes(PoseBook& book) override { mapping_.place(book); }
  MapCounts counts() const override { return count(*node_.tracker().map()); }

 private:
  /// Returns null without contention: if it is off, or if mapping runs between two frames.
  static std::unique_ptr<MapLock> made_lock(MobileNode& node, const Parameters& parameters) {
    if (!parameters.boolean("contention") || parameters.boolean("sequential")) return nullptr;
    return std::make_unique<MapLock>(node.runtime(), node.log());
  }

  MobileNode& node_;
  std::unique_ptr<MapLock> lock_;
  OnboardMapping mapping_;
};

}  // namespace

System orbslam2_system() {
  System system;
  system.name = "orbslam2";
  system.sensors = {SensorKind::kRgbd, SensorKind::kStereo, SensorKind::kMono};
  system.parameters = orbslam2::parameter_specs();
  system.orb = orb_options;
  system.tracker = [](const Parameters& parameters) { return tracker_options(parameters); };
  system.sequential = [](const Parameters& parameters) { return parameters.boolean("sequential"); };
  system.prior_map = [](const Parameters& parameters) { return parameters.text("prior_map"); };
  system.save_map = [](const Parameters& parameters) { return parameters.boolean("save_map"); };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<OrbSlam2Policy>(node, parameters);
  };
  return system;
}

}  // namespace slambed
