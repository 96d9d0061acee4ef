// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/switched_mapping.hpp"

#include <utility>

namespace slambed {
namespace {

/// Time after playback for keyframes that waited for a hand-over.
constexpr Duration kHeldPatience = std::chrono::seconds(2);
constexpr Duration kLookEvery = std::chrono::milliseconds(20);

Channel& open_handover(Network& network) { return network.open({.name = "handover"}); }

}  // namespace

SwitchedMapping::SwitchedMapping(MobileNode& node, const Parameters& parameters)
    : node_(node),
      offload_(node, parameters),
      contact_(node, open_handover(node.network()), offload_.channels().keyframe,
               contact_options(parameters)),
      mapping_(node.runtime(), node.log(), {}, node.tracker().map(), IdSpace::kMobileMapper,
               LocalMapping::Mode::kWorker) {
  offload_.downlink().on_applied([this](const wire::MapUpdate&, const std::shared_ptr<Map>& map) {
    contact_.received(map);
    mapping_.reset(map);
  });
}

void SwitchedMapping::start() {
  offload_.start();
  contact_.start();
  mapping_.park(true);
  mapping_.start();
}

void SwitchedMapping::before_frame(Worker& worker) {
  offload_.before_frame(worker);
  finish_handover(worker);
  if (contact_.edge_is_empty() && place_ != MappingPlace::kMobile && !contact_.handing_over()) {
    node_.log().warning("the edge has no map; it gets the one there is here");
    begin_epoch();
    mapping_.park(false);
    contact_.hand_over(epoch_, node_.tracker().map());
    announce(contact_.rtt(worker.now()));
  }
}

void SwitchedMapping::after_frame(Worker& worker, const TrackedFrame& frame) {
  offload_.note_relocalization(frame);
  if (place_ != MappingPlace::kMobile) offload_.relocalize_after_frame(worker, frame);
}

/// From now on, maps that the edge sent before are declined.
void SwitchedMapping::begin_epoch() {
  ++epoch_;
  offload_.downlink().begin_epoch(epoch_);
}

void SwitchedMapping::announce(std::optional<Duration> rtt) {
  contact_.announce(
      {.state = static_cast<std::uint8_t>(place_), .epoch = epoch_, .time = {}, .rtt = rtt},
      place_ == MappingPlace::kMobile);
}

std::uint64_t SwitchedMapping::move_to(MappingPlace place, std::optional<Duration> rtt) {
  const MappingPlace from = std::exchange(place_, place);
  if (place == MappingPlace::kMobile) {
    begin_epoch();
    contact_.stop(epoch_);
    deferred_.clear();
  }
  if (place != MappingPlace::kEdge) {
    mapping_.park(false);
    node_.tracker().accept_keyframes();
  }
  if (from == MappingPlace::kMobile) contact_.hand_over(epoch_, node_.tracker().map());
  announce(rtt);
  return epoch_;
}

void SwitchedMapping::finish_handover(Worker& worker) {
  if (contact_.handing_over() || place_ == MappingPlace::kMobile) return;
  if (place_ == MappingPlace::kEdge) mapping_.park(true);
  send_deferred(worker);
}

void SwitchedMapping::send_deferred(Worker& worker) {
  if (deferred_.empty() || offload_.channels().keyframe.path().unacknowledged_bytes > 0) return;
  DeferredKeyFrame next = std::move(deferred_.front());
  deferred_.pop_front();
  send(worker, next.frame, std::move(next.made), next.need);
}

void SwitchedMapping::send(Worker& worker, const TrackedFrame& frame, MapDelta made,
                           KeyFrameNeed need) {
  const bool first = frame.outcome.initialized_now;
  offload_.send(worker, frame, std::move(made), need, first, first);
  contact_.keyframe_sent(worker.now());
}

bool SwitchedMapping::wants_keyframe() {
  return place_ == MappingPlace::kMobile ? node_.tracker().wants_keyframe(mapping_.status())
                                         : node_.tracker().keyframe_need() != KeyFrameNeed::kNone;
}

void SwitchedMapping::make_keyframe(Worker& worker, const TrackedFrame& frame) {
  const KeyFrameNeed need = node_.tracker().keyframe_need();
  const bool here = maps_here() && node_.tracker().wants_keyframe(mapping_.status());
  // A keyframe for the edge alone, which may still decline it, must not become the reference.
  const bool certain = here || need == KeyFrameNeed::kUrgent || frame.outcome.initialized_now;
  MapDelta made = offload_.create_keyframe(worker, frame, need, certain);
  if (made.keyframes.empty()) return;
  if (here)
    for (const NewKeyFrame& keyframe : made.keyframes) mapping_.submit(worker, keyframe.id);
  if (place_ == MappingPlace::kMobile) return;
  if (contact_.handing_over() || !deferred_.empty()) {
    offload_.downlink().expect_keyframe(made.keyframes.back().id);
    deferred_.push_back({frame, std::move(made), need});
  } else {
    send(worker, frame, std::move(made), need);
  }
}

void SwitchedMapping::finish(Worker& worker) {
  edge_has_the_map_ = place_ != MappingPlace::kMobile && !contact_.handing_over();
  if (maps_here()) mapping_.drained().wait(worker);
  const RunTime patience = worker.now() + kHeldPatience;
  while (!deferred_.empty() && !contact_.handing_over() && !worker.stopping() &&
         worker.now() < patience) {
    send_deferred(worker);
    worker.sleep_until(worker.now() + kLookEvery);
  }
  offload_.shut_down(worker);
}

void SwitchedMapping::place_keyframes(PoseBook& book) const {
  offload_.shutdown().place_keyframes(book);
  if (edge_has_the_map_ && offload_.shutdown().answered()) return;
  // The edge lacks the latest changes of this map, or did not answer.
  book.placed_in(*node_.tracker().map());
}

MapCounts SwitchedMapping::counts() const {
  return edge_has_the_map_ ? offload_.shutdown().counts() : count(*node_.tracker().map());
}

SwitchedMappingEdge::SwitchedMappingEdge(EdgeNode& node, const Parameters& parameters)
    : offload_(node, parameters),
      handover_(node, offload_.mapping(), open_handover(node.network())) {}

void SwitchedMappingEdge::start() {
  offload_.start();
  handover_.start();
}

}  // namespace slambed
