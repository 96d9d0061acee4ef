// SPDX-License-Identifier: Apache-2.0
#include "edgeslam/policies.hpp"

#include <utility>

#include "node/messaging.hpp"
#include "offload/maps/update_content.hpp"
#include "offload/nodes/settings.hpp"
#include "wire/message_type.hpp"

namespace slambed {

EdgeSlamMobile::EdgeSlamMobile(MobileNode& node, const Parameters& parameters,
                               const OffloadMobileParts& parts)
    : node_(node), offload_(node, parameters, parts) {
  offload_.downlink().on_applied([this, begins_there = !edge_prior_map(parameters).empty()](
                                     const wire::MapUpdate&, const std::shared_ptr<Map>&) {
    edge_has_map_ = true;
    // The mobile relocalized in the edge's prior map, so the edge needs no map from here.
    if (begins_there && edge_session_ == 0) edge_session_ = node_.network().peer().session;
  });
}

void EdgeSlamMobile::before_frame(Worker& worker, const OfferedFrame&) {
  offload_.before_frame(worker);
  while (const auto message = offload_.channels().keyframe.try_receive()) {
    if (!is(*message, wire::kKeyFrameWanted)) continue;
    // The edge asks once for each keyframe in transit; one answer is enough.
    if (std::exchange(edge_has_map_, false)) keyframe_wanted_ = true;
  }
}

void EdgeSlamMobile::after_frame(Worker& worker, const TrackedFrame& frame) {
  offload_.note_relocalization(frame);
  offload_.relocalize_after_frame(worker, frame);
  if (frame.outcome.state != TrackingState::kOk) return;
  // A restarted edge has no map; it starts one with a keyframe that is made at once.
  const PeerState edge = node_.network().peer();
  const bool edge_is_new =
      edge.connected && edge.session != edge_session_ && !frame.outcome.initialized_now;
  const bool at_once = edge_is_new || keyframe_wanted_;
  const KeyFrameNeed need = at_once ? KeyFrameNeed::kUrgent : node_.tracker().keyframe_need();
  if (need == KeyFrameNeed::kNone) return;
  // A keyframe that the edge may still decline must not become the reference.
  const bool certain = need == KeyFrameNeed::kUrgent || frame.outcome.initialized_now;
  MapDelta made = offload_.create_keyframe(worker, frame, need, certain);
  if (made.keyframes.empty()) return;
  // The first keyframe of a map is whole as created; later ones refer to points sent before.
  const bool whole = edge_is_new || !edge_has_map_;
  if (whole) {
    const auto keyframes = keyframes_of(made);
    made = node_.tracker().map()->read(
        [&](const MapView& view) { return extract_keyframes(view, keyframes); });
  }
  if (edge_is_new) {
    node_.log().write(JsonLine("edge_restarted")
                          .add("keyframe", made.keyframes.back().id.value)
                          .add("session", edge.session));
  }
  const bool first = edge_is_new || frame.outcome.initialized_now;
  if (first) edge_session_ = edge.session;
  offload_.send(worker, frame, std::move(made), need, first, whole || first);
  keyframe_wanted_ = false;
}

void EdgeSlamMobile::place_keyframes(PoseBook& book) { offload_.shutdown().place_keyframes(book); }

}  // namespace slambed
