// SPDX-License-Identifier: Apache-2.0
#include "example_backpressure/example_backpressure.hpp"

#include "offload/sides.hpp"

namespace slambed {
namespace {

class BackpressureMobile final : public MobilePolicy {
 public:
  BackpressureMobile(MobileNode& node, const Parameters& parameters)
      : node_(node),
        offload_(node, parameters),
        limit_bytes_(static_cast<std::uint64_t>(1000 * parameters.real("backlog_kb"))) {}

  void start() override { offload_.start(); }
  void before_frame(Worker& worker, const OfferedFrame&) override { offload_.before_frame(worker); }

  void after_frame(Worker& worker, const TrackedFrame& frame) override {
    offload_.note(frame);
    offload_.ask(worker, frame);  // while tracking is lost
    if (frame.outcome.state != TrackingState::kOk) return;
    const KeyFrameNeed need = node_.tracker().keyframe_need();
    if (need == KeyFrameNeed::kNone) return;
    const bool first = frame.outcome.initialised_now;
    const bool urgent = first || need == KeyFrameNeed::kUrgent;
    if (!urgent && withhold()) return;
    // The edge may decline a keyframe: only one that it must take becomes the reference.
    MapDelta made = offload_.create_keyframe(worker, frame, need, urgent);
    if (!made.keyframes.empty()) offload_.send(worker, frame, std::move(made), need, first, first);
  }

  std::string_view relocalised_by(const TrackedFrame& frame) override {
    return offload_.relocalised_by(frame);
  }
  void finish(Worker& worker) override { offload_.say_goodbye(worker); }
  void place_keyframes(PoseBook& book) override {
    for (const KeyFramePose& pose : offload_.farewell().poses()) book.placed(pose.id, pose.T_cw);
  }
  MapCounts counts() const override { return offload_.farewell().counts(); }

 private:
  bool withhold() {
    const std::uint64_t backlog = offload_.channels().keyframe.path().unacknowledged_bytes;
    if (backlog <= limit_bytes_) return false;
    node_.log().write(JsonLine("keyframe_withheld").add("backlog_bytes", backlog));
    return true;
  }

  MobileNode& node_;
  OffloadMobile offload_;
  std::uint64_t limit_bytes_;
};

class BackpressureEdge final : public EdgePolicy {
 public:
  BackpressureEdge(EdgeNode& node, const Parameters& parameters) : offload_(node, parameters) {}
  void start() override { offload_.start(); }
  std::shared_ptr<const Map> map() const override { return offload_.map(); }

 private:
  OffloadEdge offload_;
};

}  // namespace

System example_backpressure_system() {
  System system = offload_system("example_backpressure");
  system.parameters.push_back(ParameterSpec::real("backlog_kb", 0, 1'000'000));
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<BackpressureMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<BackpressureEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
