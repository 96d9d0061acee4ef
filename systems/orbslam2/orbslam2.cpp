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
        mapping_(node.runtime(), node.log(), node.tracker().map(), node.places(),
                 {.mode = parameters.boolean("sequential") ? LocalMapping::Mode::kSequential
                                                           : LocalMapping::Mode::kWorker,
                  .loop_closing = parameters.boolean("loop_closing")}) {}

  void start() override { mapping_.start(); }
  void after_frame(Worker& worker, const TrackedFrame& frame) override {
    mapping_.after_frame(worker, node_.tracking(), frame);
  }
  void finish(Worker& worker) override { mapping_.drain(worker); }
  void place_keyframes(PoseBook& book) override { mapping_.place(book); }
  MapCounts counts() const override { return count(*node_.tracker().map()); }

 private:
  MobileNode& node_;
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
