// SPDX-License-Identifier: Apache-2.0
#include "orbslam2/orbslam2.hpp"

#include <optional>

#include "node/local_mapping.hpp"
#include "node/loop_closing.hpp"
#include "node/mobile_node.hpp"

namespace slambed {
namespace {

class OrbSlam2Policy final : public MobilePolicy {
 public:
  OrbSlam2Policy(MobileNode& node, const Parameters& parameters)
      : node_(node),
        mode_(parameters.boolean("sequential") ? LocalMapping::Mode::kSequential
                                               : LocalMapping::Mode::kWorker),
        mapping_(node.runtime(), node.log(), {}, node.tracker().map(), IdSpace::kMobileMapper,
                 mode_, parameters.boolean("loop_closing") ? loop_hooks() : MappingHooks()) {
    if (!parameters.boolean("loop_closing")) return;
    loops_.emplace(node.runtime(), node.log(), LoopCloserOptions(), node.tracker().map(),
                   node.places(), mapping_, mode_);
  }

  void start() override {
    mapping_.start();
    if (loops_) loops_->start();
  }

  void after_frame(Worker& worker, const TrackedFrame& frame) override {
    if (frame.outcome.reset_now) {
      const auto map = node_.tracker().map();
      mapping_.reset(map).wait(worker);
      map->clear();  // of what the mapper committed before it heard of the reset
    }
    if (frame.outcome.state != TrackingState::kOk ||
        !node_.tracker().wants_keyframe(mapping_.status())) {
      return;
    }
    const MapDelta made =
        node_.create_keyframe(worker, frame, node_.tracker().keyframe_need(), true);
    for (const NewKeyFrame& keyframe : made.keyframes) mapping_.submit(worker, keyframe.id);
  }

  void finish(Worker& worker) override {
    mapping_.drained().wait(worker);
    if (loops_) loops_->drain(worker);
  }

  void place_keyframes(PoseBook& book) override {
    // Also those that were culled: the map knows them through their parents.
    const auto map = node_.tracker().map();
    for (const KeyFrameId id : book.keyframes()) {
      const auto pose = map->read([&](const MapView& view) { return view.pose_of(id); });
      if (pose) book.placed(id, *pose);
    }
  }

  MapCounts counts() const override { return count(*node_.tracker().map()); }

 private:
  MappingHooks loop_hooks() {
    return {.take = {},
            .done = [this](Worker& worker, KeyFrameId id) { loops_->mapped(worker, id); },
            .idle =
                [this](Worker& worker) {
                  loops_->idle(worker);
                  return kNever;
                },
            .changed = [this] { loops_->map_changed(); }};
  }

  MobileNode& node_;
  LocalMapping::Mode mode_;
  LocalMapping mapping_;
  std::optional<LoopClosing> loops_;
};

}  // namespace

System orbslam2_system() {
  System system;
  system.name = "orbslam2";
  system.sensors = {SensorKind::kRgbd, SensorKind::kStereo, SensorKind::kMono};
  system.parameters = {ParameterSpec::integer("n_orb", 50, 10'000),
                       ParameterSpec::boolean("loop_closing"),
                       ParameterSpec::boolean("second_hypotheses"),
                       ParameterSpec::boolean("sequential"), ParameterSpec::path("prior_map"),
                       ParameterSpec::boolean("save_map")};
  system.orb = [](const Parameters& parameters) {
    OrbOptions options;
    options.features = parameters.integer("n_orb");
    return options;
  };
  system.tracker = [](const Parameters& parameters) {
    TrackerOptions options;
    options.min_init_features = std::min(500, parameters.integer("n_orb") / 2);
    options.second_hypotheses = parameters.boolean("second_hypotheses");
    return options;
  };
  system.sequential = [](const Parameters& parameters) { return parameters.boolean("sequential"); };
  system.prior_map = [](const Parameters& parameters) { return parameters.text("prior_map"); };
  system.save_map = [](const Parameters& parameters) { return parameters.boolean("save_map"); };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<OrbSlam2Policy>(node, parameters);
  };
  return system;
}

}  // namespace slambed
