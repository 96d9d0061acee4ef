// SPDX-License-Identifier: Apache-2.0
#include "offload/uplink/keyframe_uplink.hpp"

#include "node/messaging.hpp"
#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed {

void KeyFrameUplink::send(Worker& worker, const TrackedFrame& frame, MapDelta delta,
                          const About& about) {
  if (delta.keyframes.empty()) return;
  wire::KeyFrameMessage message;
  message.keyframe = delta.keyframes.back().id;
  message.captured = frame.offered.offered;
  message.urgent = about.need == KeyFrameNeed::kUrgent;
  message.first = about.first;
  message.whole = about.whole;
  message.after_relocalization = about.after_relocalization;
  message.applied_update = about.applied_update;
  message.newest_edge_point = about.newest_edge_point;
  message.delta = std::move(delta);
  Bytes payload = codec_.serialize(worker, message, *node_.tracker().map());
  last_sequence_ = slambed::send(channel_, wire::kKeyFrame, std::move(payload));
  node_.log().write(JsonLine("keyframe_sent").add("keyframe", message.keyframe.value));
}

}  // namespace slambed
