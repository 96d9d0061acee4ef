// SPDX-License-Identifier: Apache-2.0
#include "example_backpressure/example_backpressure.hpp"

#include <optional>

#include "example_backpressure/backlog_message.hpp"
#include "example_backpressure/parameters.hpp"
#include "offload/nodes/offload_edge.hpp"
#include "offload/nodes/offload_mobile.hpp"
#include "offload/nodes/settings.hpp"

namespace slambed {
namespace example_backpressure {
namespace {

constexpr const char* kChannel = "backlog";
constexpr Duration kLookEvery = std::chrono::milliseconds(50);

class BackpressureMobile final : public MobilePolicy {
 public:
  BackpressureMobile(MobileNode& node, const Parameters& parameters)
      : node_(node),
        offload_(node, parameters),
        backlog_(node.network().open({.name = kChannel})),
        inbox_(node.log()),
        limit_bytes_(static_cast<std::uint64_t>(1000 * parameters.real("backlog_kb"))),
        limit_keyframes_(parameters.integer("backlog_keyframes")) {
    inbox_.on<BacklogMessage>(decode_backlog,
                              [this](const BacklogMessage& backlog, const Message&) {
                                waiting_ = static_cast<int>(backlog.keyframes);
                              });
  }

  void start() override { offload_.start(); }
  void before_frame(Worker& worker, const OfferedFrame&) override {
    while (auto message = backlog_.try_receive()) inbox_.dispatch(std::move(*message));
    offload_.before_frame(worker);
  }

  void after_frame(Worker& worker, const TrackedFrame& frame) override {
    offload_.note_relocalization(frame);
    offload_.relocalize_after_frame(worker, frame);  // while tracking is lost
    if (frame.outcome.state != TrackingState::kOk) return;
    const KeyFrameNeed need = node_.tracker().keyframe_need();
    if (need == KeyFrameNeed::kNone) return;
    const bool first = frame.outcome.initialized_now;
    const bool urgent = first || need == KeyFrameNeed::kUrgent;
    if (!urgent && withhold()) return;
    // The edge may decline a keyframe: only one that it must take becomes the reference.
    MapDelta made = offload_.create_keyframe(worker, frame, need, urgent);
    if (!made.keyframes.empty()) offload_.send(worker, frame, std::move(made), need, first, first);
  }

  std::string_view relocalized_by(const TrackedFrame& frame) override {
    return offload_.relocalized_by(frame);
  }
  void finish(Worker& worker) override { offload_.shut_down(worker); }
  void place_keyframes(PoseBook& book) override { offload_.shutdown().place_keyframes(book); }
  MapCounts counts() const override { return offload_.shutdown().counts(); }

 private:
  bool withhold() {
    const std::uint64_t backlog = offload_.channels().keyframe.path().unacknowledged_bytes;
    if (backlog <= limit_bytes_ && waiting_ <= limit_keyframes_) return false;
    node_.log().write(JsonLine("keyframe_withheld")
                          .add("backlog_bytes", backlog)
                          .add("backlog_keyframes", waiting_));
    return true;
  }

  MobileNode& node_;
  OffloadMobile offload_;
  Channel& backlog_;
  Inbox inbox_;
  std::uint64_t limit_bytes_;
  int limit_keyframes_;
  int waiting_ = 0;  ///< keyframes that the edge has not mapped yet, as last reported
};

class BackpressureEdge final : public EdgePolicy {
 public:
  BackpressureEdge(EdgeNode& node, const Parameters& parameters)
      : node_(node),
        offload_(node, parameters),
        backlog_(node.network().open({.name = kChannel})) {}

  void start() override {
    offload_.start();
    node_.runtime().spawn("backlog", [this](Worker& worker) { report(worker); });
  }
  std::shared_ptr<const Map> map() const override { return offload_.map(); }

 private:
  /// Runs in this system's own stage; system.yaml says what it costs (`stages`).
  void report(Worker& worker) {
    // A new edge also reports 0: the mobile may still have the previous edge's number.
    for (std::optional<std::uint32_t> sent; !worker.stopping();
         worker.sleep_until(worker.now() + kLookEvery)) {
      const MapperStatus mapper = offload_.mapping().mapper().status();
      const auto waiting = static_cast<std::uint32_t>(mapper.queued + (mapper.idle ? 0 : 1));
      if (waiting == sent) continue;
      sent = waiting;
      worker.stage("report_backlog",
                   [&](StageUnits&) { send(backlog_, BacklogMessage{.keyframes = waiting}); });
    }
  }

  EdgeNode& node_;
  OffloadEdge offload_;
  Channel& backlog_;
};

}  // namespace
}  // namespace example_backpressure

System example_backpressure_system() {
  using namespace example_backpressure;
  System system = offload_system("example_backpressure", parameter_specs());
  system.channels.emplace_back(kChannel);
  system.messages = {kMessages};
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<BackpressureMobile>(node, parameters);
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<BackpressureEdge>(node, parameters);
  };
  return system;
}

}  // namespace slambed
