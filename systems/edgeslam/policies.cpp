// SPDX-License-Identifier: Apache-2.0
#include "edgeslam/policies.hpp"

#include <array>

#include "offload/update_content.hpp"

namespace slambed {

void EdgeSlamMobile::after_frame(Worker& worker, const TrackedFrame& frame) {
  offload_.note(frame);
  offload_.ask(worker, frame);
  if (frame.outcome.state != TrackingState::kOk) return;
  // A restarted edge knows nothing: its map begins with a keyframe made at once.
  const PeerState edge = node_.network().peer();
  const bool edge_is_new = edge.connected && edge.incarnation != edge_incarnation_ &&
                           !frame.outcome.initialised_now;
  const KeyFrameNeed need =
      edge_is_new ? KeyFrameNeed::kUrgent : node_.tracker().keyframe_need();
  if (need == KeyFrameNeed::kNone) return;
  // A keyframe that the edge may still decline must not become the reference.
  const bool certain = need == KeyFrameNeed::kUrgent || frame.outcome.initialised_now;
  MapDelta made = offload_.create_keyframe(worker, frame, need, certain);
  if (made.keyframes.empty()) return;
  if (edge_is_new) {
    const std::array first{made.keyframes.front().id};
    made = node_.tracker().map()->read(
        [&](const MapView& view) { return extract_keyframes(view, first); });
    node_.log().write(JsonLine("edge_restarted")
                          .add("keyframe", first.front().value)
                          .add("incarnation", edge.incarnation));
  }
  const bool first = edge_is_new || frame.outcome.initialised_now;
  if (first) edge_incarnation_ = edge.incarnation;
  offload_.send(worker, frame, std::move(made), need, first);
}

void EdgeSlamMobile::place_keyframes(PoseBook& book) {
  for (const KeyFramePose& pose : offload_.farewell().poses()) book.placed(pose.id, pose.T_cw);
}

}  // namespace slambed
