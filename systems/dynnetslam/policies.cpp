// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/policies.hpp"

namespace slambed::dynnetslam {
namespace {

StrategyOptions strategy_options(const Parameters& parameters) {
  const double safe_ms = parameters.real("l_sz_ms");
  return {.hysteresis = parameters.boolean("hysteresis"),
          .safe_zone = parameters.boolean("safe_zone"),
          .limit_ms = parameters.real("l_ol_ms"),
          .band_ms = parameters.real("b_ms"),
          .safe_limit_ms = safe_ms >= 0 ? std::optional(safe_ms) : std::nullopt};
}

LinkOptions link_options(const Parameters& parameters) {
  const std::string source = parameters.text("rtt_source");
  return {.source = source == "echo"      ? RttSource::kEcho
                    : source == "profile" ? RttSource::kProfile
                                          : RttSource::kTcpInfo,
          .missing = from_seconds(parameters.real("rtt_missing_s")),
          .probe_hz = parameters.real("mes_probe_hz"),
          .probe_bytes = parameters.integer("mes_probe_bytes")};
}

/// Playback is over: so long for keyframes that waited for a hand-over.
constexpr Duration kHeldPatience = std::chrono::seconds(2);
constexpr Duration kLookEvery = std::chrono::milliseconds(20);

Channel& open_handover(Network& network) { return network.open({.name = "handover"}); }

std::optional<double> in_ms(std::optional<Duration> rtt) {
  return rtt ? std::optional(to_ms(*rtt)) : std::nullopt;
}

}  // namespace

DynNetSlamMobile::DynNetSlamMobile(MobileNode& node, const Parameters& parameters)
    : node_(node),
      thresholds_(thresholds(strategy_options(parameters))),
      decision_gap_(from_seconds(parameters.real("decision_gap_s"))),
      offload_(node, parameters),
      contact_(node, open_handover(node.network()), offload_.channels().keyframe,
               link_options(parameters), parameters.real("echo_hz")),
      mapping_(node.runtime(), node.log(), {}, node.tracker().map(), IdSpace::kMobileMapper,
               LocalMapping::Mode::kWorker) {
  offload_.downlink().on_applied([this](const wire::MapUpdate&, const std::shared_ptr<Map>& map) {
    contact_.received(map);
    mapping_.reset(map);
  });
}

void DynNetSlamMobile::start() {
  offload_.start();
  contact_.start();
  mapping_.park(true);
  mapping_.start();
}

void DynNetSlamMobile::before_frame(Worker& worker, const OfferedFrame&) {
  offload_.before_frame(worker);
  settle_handover(worker);
  if (contact_.edge_is_empty() && state_ != State::kMobile && !contact_.handing_over()) {
    node_.log().warning("the edge has no map; it gets the one there is here");
    begin_epoch();
    mapping_.park(false);
    contact_.hand_over(epoch_, node_.tracker().map());
    contact_.announce(state_, epoch_, contact_.rtt(worker.now()));
  }
}

/// What the edge sent before is worthless from now on.
void DynNetSlamMobile::begin_epoch() {
  ++epoch_;
  offload_.downlink().begin_epoch(epoch_);
}

void DynNetSlamMobile::after_frame(Worker& worker, const TrackedFrame& frame) {
  offload_.note(frame);
  if (state_ != State::kMobile) offload_.ask(worker, frame);
  if (frame.outcome.state == TrackingState::kOk) {
    const bool wanted = state_ == State::kMobile
                            ? node_.tracker().wants_keyframe(mapping_.status())
                            : node_.tracker().keyframe_need() != KeyFrameNeed::kNone;
    if (wanted) {
      decide(worker);
      return make_keyframe(worker, frame);
    }
  }
  // The camera may stand still, or be lost: without keyframes no state must become a trap.
  if (decided_ && decision_gap_ > Duration::zero() &&
      worker.now() - last_decision_ >= decision_gap_) {
    decide(worker);
  }
}

void DynNetSlamMobile::decide(Worker& worker) {
  last_decision_ = worker.now();
  const auto rtt = contact_.rtt(worker.now());
  const State next = decided_ ? next_state(state_, in_ms(rtt), thresholds_)
                              : initial_state(in_ms(rtt), thresholds_);
  if (decided_ && next == state_) return;
  enter(worker, next, rtt);
}

void DynNetSlamMobile::enter(Worker& worker, State next, std::optional<Duration> rtt) {
  const State from = state_;
  state_ = next;
  if (next == State::kMobile) {
    begin_epoch();
    contact_.stop(epoch_);
    held_.clear();
  }
  if (next != State::kOffloading) {
    mapping_.park(false);
    node_.tracker().accept_keyframes();
  }
  if (from == State::kMobile) contact_.hand_over(epoch_, node_.tracker().map());
  contact_.announce(next, epoch_, rtt);
  JsonLine event("state_changed");
  event.add("from", decided_ ? to_string(from) : "start").add("to", to_string(next));
  if (rtt) event.add_ms("rtt_ms", *rtt);
  node_.log().write(event.add("epoch", epoch_));
  decided_ = true;
  settle_handover(worker);
}

void DynNetSlamMobile::settle_handover(Worker& worker) {
  if (contact_.handing_over() || state_ == State::kMobile) return;
  if (state_ == State::kOffloading) mapping_.park(true);
  send_held(worker);
}

void DynNetSlamMobile::send_held(Worker& worker) {
  if (held_.empty() || offload_.channels().keyframe.path().unacknowledged_bytes > 0) return;
  HeldKeyFrame next = std::move(held_.front());
  held_.pop_front();
  send(worker, next.frame, std::move(next.made), next.need);
}

void DynNetSlamMobile::send(Worker& worker, const TrackedFrame& frame, MapDelta made,
                            KeyFrameNeed need) {
  const bool first = frame.outcome.initialised_now;
  offload_.send(worker, frame, std::move(made), need, first, first);
  contact_.keyframe_sent(worker.now());
}

void DynNetSlamMobile::make_keyframe(Worker& worker, const TrackedFrame& frame) {
  const KeyFrameNeed need = node_.tracker().keyframe_need();
  const bool here = maps_here() && node_.tracker().wants_keyframe(mapping_.status());
  // A keyframe that only the edge may want, and still decline, must not become the reference.
  const bool certain = here || need == KeyFrameNeed::kUrgent || frame.outcome.initialised_now;
  MapDelta made = offload_.create_keyframe(worker, frame, need, certain);
  if (made.keyframes.empty()) return;
  if (here)
    for (const NewKeyFrame& keyframe : made.keyframes) mapping_.submit(worker, keyframe.id);
  if (state_ == State::kMobile) return;
  if (contact_.handing_over() || !held_.empty()) {
    offload_.downlink().expect_keyframe(made.keyframes.back().id);
    held_.push_back({frame, std::move(made), need});
  } else {
    send(worker, frame, std::move(made), need);
  }
}

void DynNetSlamMobile::finish(Worker& worker) {
  edge_has_the_map_ = state_ != State::kMobile && !contact_.handing_over();
  if (maps_here()) mapping_.drained().wait(worker);
  const RunTime patience = worker.now() + kHeldPatience;
  while (!held_.empty() && !contact_.handing_over() && !worker.stopping() &&
         worker.now() < patience) {
    send_held(worker);
    worker.sleep_until(worker.now() + kLookEvery);
  }
  offload_.say_goodbye(worker);
}

void DynNetSlamMobile::place_keyframes(PoseBook& book) {
  for (const KeyFramePose& pose : offload_.farewell().poses()) book.placed(pose.id, pose.T_cw);
  if (edge_has_the_map_ && offload_.farewell().answered()) return;
  // The edge has not seen how the map went on here, or is not there to tell.
  const auto map = node_.tracker().map();
  for (const KeyFrameId id : book.keyframes()) {
    const auto pose = map->read([&](const MapView& view) { return view.pose_of(id); });
    if (pose) book.placed(id, *pose);
  }
}

MapCounts DynNetSlamMobile::counts() const {
  return edge_has_the_map_ ? offload_.farewell().counts() : count(*node_.tracker().map());
}

DynNetSlamEdge::DynNetSlamEdge(EdgeNode& node, const Parameters& parameters)
    : offload_(node, parameters),
      handover_(node, offload_.mapping(), open_handover(node.network())) {}

void DynNetSlamEdge::start() {
  offload_.start();
  handover_.start();
}

}  // namespace slambed::dynnetslam
