// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/mobile_policy.hpp"

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

std::optional<double> in_ms(std::optional<Duration> rtt) {
  return rtt ? std::optional(to_ms(*rtt)) : std::nullopt;
}

MappingPlace place_of(OffloadingState state) {
  return state == OffloadingState::kOffloading ? MappingPlace::kEdge
         : state == OffloadingState::kSafeZone ? MappingPlace::kBoth
                                               : MappingPlace::kMobile;
}

}  // namespace

DynNetSlamMobile::DynNetSlamMobile(MobileNode& node, const Parameters& parameters)
    : node_(node),
      thresholds_(thresholds(strategy_options(parameters))),
      decision_gap_(from_seconds(parameters.real("decision_gap_s"))),
      mapping_(node, parameters) {}

void DynNetSlamMobile::after_frame(Worker& worker, const TrackedFrame& frame) {
  mapping_.after_frame(worker, frame);
  if (frame.outcome.state == TrackingState::kOk && mapping_.wants_keyframe()) {
    decide(worker);
    return mapping_.make_keyframe(worker, frame);
  }
  // A camera that stands still or is lost makes no keyframes; no state must become a trap then.
  if (decided_ && decision_gap_ > Duration::zero() &&
      worker.now() - last_decision_ >= decision_gap_) {
    decide(worker);
  }
}

void DynNetSlamMobile::decide(Worker& worker) {
  last_decision_ = worker.now();
  const auto rtt = mapping_.rtt(worker.now());
  const OffloadingState next = decided_ ? next_state(state_, in_ms(rtt), thresholds_)
                                        : initial_state(in_ms(rtt), thresholds_);
  if (decided_ && next == state_) return;
  change_state(worker, next, rtt);
}

void DynNetSlamMobile::change_state(Worker& worker, OffloadingState next,
                                    std::optional<Duration> rtt) {
  const std::uint64_t epoch = mapping_.move_to(place_of(next), rtt);
  JsonLine event("state_changed");
  event.add("from", decided_ ? to_string(state_) : "start").add("to", to_string(next));
  if (rtt) event.add_ms("rtt_ms", *rtt);
  node_.log().write(event.add("epoch", epoch));
  state_ = next;
  decided_ = true;
  mapping_.finish_handover(worker);
}

}  // namespace slambed::dynnetslam
